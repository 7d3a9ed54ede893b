// SI on the wire, degrees on the screen.
const DEGREES = 180 / Math.PI;
const SHOWN = { rad: ["°", DEGREES], "rad/s": ["°/s", DEGREES], "rad/s^2": ["rad/s²", 1], "m/s^2": ["m/s²", 1], "1": ["", 1] };

export function shown(unit) {
  const [text, factor] = SHOWN[unit] ?? [unit, 1];
  return { text, factor };
}

export const wrap = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

// A number of the table of logs may be missing: it is a dash, never zero.
export const number = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits).replace("-", "−") : "–");
