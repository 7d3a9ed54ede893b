"""What a rigid-body model of a real hovercraft lacks: six fans, motion capture at 240 Hz, one log.

Needs a log of the craft (not part of this project): ``python docs/tutorials/real_craft.py --data FOLDER``, by
default ``../shared/data/holohover`` beside the project.
"""

import argparse
from pathlib import Path

import hovercontrol as hc
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.report import headline, remainder_sentence, write_report
from hovercontrol.logs import read_log

CURVE = (0.02683, 1.05084, -0.43372)  # thrust [N] over the motor's signal s: of s, s^2, s^3
FANS = (
    Fan("motor_a_1", 0.044048, -0.015000, 1.570796, curve=CURVE),  # place [m], direction of push [rad]
    Fan("motor_a_2", 0.044048, 0.015000, -1.570796, curve=CURVE),
    Fan("motor_b_1", -0.009034, 0.045647, -2.617994, curve=CURVE),
    Fan("motor_b_2", -0.035014, 0.030647, 0.523599, curve=CURVE),
    Fan("motor_c_1", -0.035014, -0.030647, -0.523599, curve=CURVE),
    Fan("motor_c_2", -0.009034, -0.045647, 2.617994, curve=CURVE),
)
MODEL = Model(
    "h1",
    [
        hc.effect("fan_force", 1 / 0.1377),  # 1/mass
        hc.effect("fan_torque", 1 / 3.4e-4),  # 1/inertia, uncertain by half
        *(hc.effect(f"{axis}_linear_drag", 0.1) for axis in ("surge", "sway", "yaw")),
    ],
    fans=FANS,
)


def main() -> None:
    """Diagnose one half of the log, the other half held out."""
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).parents[3] / "shared" / "data" / "holohover"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--out", type=Path, default=Path("out/real_craft"))
    given = parser.parse_args()

    log = read_log(given.data / "h1_aligned.csv", inputs=[fan.name for fan in FANS])
    middle = 0.5 * (log.time[0] + log.time[-1])
    first, second = log.between(log.time[0], middle), log.between(middle, log.time[-1])
    found = diagnose(MODEL, [first], second)

    print("verdict:", found.verdict)
    print(headline(found))
    print(remainder_sentence(found))
    lag = found.evidence["fan_lag"].blocks
    print(f"segments that agree on its sign: {lag.same_sign} of {lag.n}")
    for a in found.ahead:
        if a.horizon == 0.2:
            print(f"error of {a.channel} 0.2 s ahead: {a.before:.3g} -> {a.after:.3g} {a.unit}")
    given.out.mkdir(parents=True, exist_ok=True)
    found.save(given.out)
    write_report(found, given.out / "report.html")


if __name__ == "__main__":
    main()
