"""K06's gyro over frequency: gain and delay, and what the compensation gains (table 6.5)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.csv
from matplotlib.figure import Figure

from hovercontrol.analysis.k06.bench import TABLE_6_5, gyro_sines, gyro_transfer
from hovercontrol.analysis.output import Progress, save, script

#: The gyro's period [s], and its pure delay, of which (6.2) knows nothing [ms].
TICK, PURE = 0.0065536, 2 * 6.5536


def main(out: Path, progress: Progress | None = None, *, points: int = 200) -> list[Path]:
    """Draw gain and delay of (6.2), of a bench run with sines, and of K06's table."""
    tell = progress or (lambda share: None)
    frequency, *printed = TABLE_6_5.T
    curve = np.linspace(1.0, 60.0, points)
    gyro, _, _ = gyro_transfer(curve)
    exact, rounded = (gyro_transfer(frequency, digits=n)[2] for n in (None, 2))
    line = gyro_transfer(curve, digits=None)[2]
    tell(0.2)
    raw, compensated = gyro_sines(frequency)
    tell(0.8)
    figure = Figure(figsize=(16.0, 5.5), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    runs = {
        "uncompensated": (raw, printed[:2], "o", "-"),
        "compensated": (compensated, printed[2:4], "s", "--"),
    }
    late = {"uncompensated": _delay(gyro, curve) + PURE, "compensated": np.full(points, PURE)}
    gains = {"uncompensated": abs(gyro), "compensated": np.ones(points)}
    for name, (run, table, mark, dash) in runs.items():
        fill = "none" if name == "compensated" else "black"
        left.plot(curve, gains[name], color="black", ls=dash, label=f"(6.2), {name}")
        left.plot(frequency, table[0], mark, color="black", mfc=fill, ms=8, label=f"table 6.5, {name}")
        middle.plot(curve, late[name], color="black", ls=dash, label=f"(6.2) and two samples, {name}")
        middle.plot(
            frequency, -1000 * table[1] / (2 * np.pi * frequency), mark, color="black", mfc=fill, ms=8,
            label=f"table 6.5, {name}",
        )  # fmt: skip
        for axes, values in ((left, abs(run)), (middle, _delay(run, frequency))):
            axes.plot(frequency, values, "x", color="0.5", ms=9, label=f"bench, {name}")
    left.set(xlabel="frequency [Hz]", ylabel="gain", ylim=(0.0, 2.0))
    left.set_title("Gain of the gyro's reading", fontsize=11)
    middle.set(xlabel="frequency [Hz]", ylabel="delay: phase over frequency [ms]", ylim=(0.0, None))
    middle.set_title("Delay of the gyro's reading", fontsize=11)
    right.plot(curve, line, "k-", label="inverse of (6.2)")
    right.plot(frequency, printed[4], "ko", ms=8, label="table 6.5")
    right.plot(
        frequency, rounded, "x", color="0.5", ms=9, label="(6.2), phases rounded to 0.01 rad as printed"
    )
    right.set(xlabel="frequency [Hz]", ylabel="dt [ms]")
    right.set_title("Change of delay by the compensation", fontsize=11)
    for axes in (left, middle, right):
        axes.legend(frameon=False, fontsize=9)
    off = abs(rounded - printed[4]).max()
    worst = abs(exact - printed[4]).max()
    findings = [
        f"Table 6.5: the inverse of (6.2) gives every dt within {off:.3f} ms where phases are rounded to "
        f"0.01 rad as K06 prints them, within {worst:.3f} ms unrounded.",
        "The table's gains, compensated over uncompensated, are those of the inverse within "
        f"{abs(printed[2] / printed[0] * abs(raw) - 1).max():.1%}. Its phases at 10 Hz, both, are about 4 "
        "ms early beside those at the other frequencies.",
        "The table's other columns are of the real gyro: with two samples (13.1 ms) of pure delay the "
        f"modelled delay without compensation is {_delay(raw, frequency).min():.1f} to "
        f"{_delay(raw, frequency).max():.1f} ms (printed "
        f"{(-1000 * printed[1] / (2 * np.pi * frequency)).min():.1f} to "
        f"{(-1000 * printed[1] / (2 * np.pi * frequency)).max():.1f} ms).",
        f"(6.2) damps high frequencies too much, as K06 says: at 50 Hz its gain is {abs(raw[-1]):.2f} "
        f"(printed {printed[0][-1]:.2f}), so its inverse raises the real gyro's to {printed[2][-1]:.2f} "
        "instead of 1.",
    ]
    columns = {
        "frequency [Hz]": frequency,
        "printed dt [ms]": printed[4],
        "reproduced dt [ms]": rounded,
        "ratio": rounded / printed[4],
        "unrounded dt [ms]": exact,
        **{
            f"{kind} {name} {what}": values
            for name, (run, table, _, _) in runs.items()
            for kind, what, values in (
                ("printed", "gain", table[0]),
                ("reproduced", "gain", abs(run)),
                ("printed", "phase [rad]", table[1]),
                ("reproduced", "phase [rad]", np.unwrap(np.angle(run))),
            )
        },
    }
    tables = {"k06_gyro": lambda path: pyarrow.csv.write_csv(pyarrow.table(columns), path)}
    tell(1.0)
    return save(out, "k06_gyro", figure, tables, findings)


def _delay(response: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    return -1000 * np.unwrap(np.angle(response)) / (2 * np.pi * frequency)


if __name__ == "__main__":
    script(main, __doc__ or "")
