// A log seen again: the same picture, with time in the pilot's hand.
export class Replay {
  constructor(elements) {
    Object.assign(this, elements); // play, seek, speed
    this.columns = null;
    this.play.addEventListener("click", () => this.toggle());
    this.seek.addEventListener("input", () => this.jump(this.seek.valueAsNumber));
  }

  open({ name, columns }) {
    this.name = name;
    this.columns = columns;
    const { time } = columns;
    [this.first, this.end] = [time[0], time.at(-1)];
    this.seek.min = this.first;
    this.seek.max = this.end;
    this.path = columns.x.map((x, k) => [x, columns.y[k]]);
    this.jump(this.first);
    this.toggle(true);
  }

  close() {
    this.columns = null;
  }

  toggle(on = !this.running) {
    if (on && this.now >= this.end) this.jump(this.first);
    this.running = on;
    this.before = performance.now();
    this.play.textContent = on ? "Pause" : "Play";
  }

  jump(time) {
    this.now = time;
    this.seek.value = time;
  }

  // Let time go on to this picture and return its signals.
  signals() {
    const now = performance.now();
    if (this.running) {
      this.now += ((now - this.before) / 1000) * Number(this.speed.value);
      this.before = now;
      if (this.now >= this.end) {
        this.now = this.end;
        this.toggle(false);
      }
      this.seek.value = this.now;
    }
    const { time } = this.columns;
    let [low, high] = [0, time.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] <= this.now) low = middle;
      else high = middle;
    }
    if (this.now >= this.end) low = high; // the last row itself
    const part = high > low ? Math.max(0, (this.now - time[low]) / (time[high] - time[low])) : 0;
    const between = ["x", "y", "psi", "u", "v", "r"]; // commands are held from row to row
    return Object.fromEntries(Object.entries(this.columns).map(([name, values]) =>
      [name, between.includes(name) ? values[low] + part * (values[high] - values[low]) : values[low]]));
  }
}
