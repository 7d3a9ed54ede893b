// The stick: keyboard, pad and gamepad in one place, with the spring that brings it back.
const PUSH = 4; // of full stick per second, towards a pressed key
const SPRING = 6; // and back
const STILL = 0.08; // of a gamepad's axis, counts as zero
const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0], ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowRight: [0, 1], KeyD: [0, 1], ArrowLeft: [0, -1], KeyA: [0, -1],
};
const limited = (value) => Math.min(1, Math.max(-1, value));

export class Stick {
  constructor(pad, knob, onMove) {
    this.pad = pad;
    this.knob = knob;
    this.value = [0, 0];
    this.pressed = new Set();
    this.dragged = null;
    this.last = performance.now();
    this.onMove = onMove;
    addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    for (const [target, type] of [[window, "blur"], [document, "visibilitychange"]]) {
      target.addEventListener(type, () => this.letGo());
    }
    pad.addEventListener("pointerdown", (event) => {
      pad.setPointerCapture(event.pointerId);
      this.drag(event);
    });
    pad.addEventListener("pointermove", (event) => this.dragged && this.drag(event));
    for (const type of ["pointerup", "pointercancel"]) pad.addEventListener(type, () => (this.dragged = null));
  }

  letGo() {
    this.pressed.clear();
    this.dragged = null;
  }

  key(event, down) {
    if (!(event.code in KEYS)) return;
    if (!down) {
      this.pressed.delete(event.code);
      return;
    }
    const field = event.target.closest?.("input[type=range], input[type=number], select");
    if (field || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    if (!event.repeat) this.onMove();
    this.pressed.add(event.code);
  }

  drag(event) {
    const box = this.pad.getBoundingClientRect();
    const part = (value, start, size) => limited(((value - start) / size - 0.5) * 2.5);
    this.dragged = [-part(event.clientY, box.top, box.height), part(event.clientX, box.left, box.width)];
    if (event.type === "pointerdown") this.onMove();
  }

  gamepad() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((found) => found?.connected);
    if (!pad) return null;
    const axis = (value) => (Math.abs(value) < STILL ? 0 : limited(value));
    const value = [-axis(pad.axes[1] ?? 0) + 0, axis(pad.axes[0] ?? 0)];
    return value[0] || value[1] ? value : null;
  }

  // Called once a frame, also where the page is not seen and nothing is drawn.
  update() {
    const now = performance.now();
    const passed = Math.min(0.1, (now - this.last) / 1000);
    this.last = now;
    const held = this.dragged ?? this.gamepad();
    if (held) {
      this.value = [...held];
    } else {
      const wanted = [0, 0];
      for (const code of this.pressed) KEYS[code].forEach((part, k) => (wanted[k] += part));
      this.value = this.value.map((value, k) => {
        const to = limited(wanted[k]);
        const step = (to ? PUSH : SPRING) * passed;
        return value < to ? Math.min(to, value + step) : Math.max(to, value - step);
      });
    }
    this.knob.style.left = `${50 + 40 * this.value[1]}%`;
    this.knob.style.top = `${50 - 40 * this.value[0]}%`;
    return this.value;
  }
}
