// Laws with their references, and disturbances with their numbers: what the pilot orders.
import { shown } from "/page/units.js";

const NAMES = {
  surge_ref: "surge", yaw_rate_ref: "yaw rate", heading_ref: "heading",
  goal_x_ref: "goal x", goal_y_ref: "goal y", goal_heading_ref: "goal heading",
};

// A slider with a field for the number; `say` is called with the value in SI.
function slider(signal, value, say, refuse) {
  const { text, factor } = shown(signal.unit);
  const label = NAMES[signal.name] ?? signal.name;
  const root = document.createElement("div");
  root.className = "slider";
  root.innerHTML = '<span></span><input type="range"><input type="number"><span class="unit"></span>';
  const [range, field] = root.querySelectorAll("input");
  root.firstChild.textContent = label;
  root.lastChild.textContent = text;
  const step = factor === 1 ? 0.01 : 1;
  for (const input of [range, field]) {
    input.step = input === range ? step : "any";
    input.setAttribute("aria-label", text ? `${label} in ${text}` : label);
  }
  range.min = Math.round((signal.lower * factor) / step) * step;
  range.max = Math.round((signal.upper * factor) / step) * step;
  const set = (si) => {
    range.value = si * factor;
    field.value = Number((si * factor).toFixed(factor === 1 ? 3 : 1));
    field.removeAttribute("aria-invalid");
  };
  // The slider's ends are rounded to whole degrees; they never ask for more than the bounds.
  range.addEventListener("input", () => {
    const si = Math.min(signal.upper, Math.max(signal.lower, range.valueAsNumber / factor));
    set(si);
    say(si);
  });
  field.addEventListener("change", () => {
    const si = field.valueAsNumber / factor;
    if (si >= signal.lower - 1e-9 && si <= signal.upper + 1e-9) {
      range.value = si * factor;
      field.removeAttribute("aria-invalid");
      say(Math.min(signal.upper, Math.max(signal.lower, si)));
      return;
    }
    const [low, high] = [signal.lower, signal.upper].map((end) => Number((end * factor).toFixed(2)));
    field.setAttribute("aria-invalid", "true");
    refuse(`${label}: expected a number from ${low} to ${high} ${text}, found ${field.value || "none"}`.replaceAll("-", "−"));
  });
  // The arrow keys are the stick's again when the pointer has let go of a slider.
  range.addEventListener("pointerup", () => range.blur());
  field.addEventListener("keydown", (event) => event.key === "Enter" && field.blur());
  set(value);
  return { root, set, busy: () => root.contains(document.activeElement) };
}

export class Panel {
  constructor(laws, references, disturbances, command, refuse) {
    this.boxes = { laws, references, disturbances };
    this.command = command;
    this.refuse = refuse;
    this.law = null;
    this.sliders = {};
  }

  build(about) {
    this.about = about;
    this.law = null;
    const { laws, disturbances } = this.boxes;
    laws.replaceChildren();
    for (const [key, { title }] of Object.entries(about.laws)) {
      const button = document.createElement("button");
      button.type = "button";
      button.value = key;
      button.className = title.length > 9 ? "long" : "";
      button.textContent = title;
      button.addEventListener("click", () => this.command({ law: key }));
      laws.append(button);
    }
    disturbances.replaceChildren();
    this.switches = Object.entries(about.disturbances).map(([key, { title, knobs }]) => this.makeSwitch(key, title, knobs));
  }

  makeSwitch(key, title, knobs) {
    const root = document.createElement("div");
    root.innerHTML = '<label class="switch"><input type="checkbox"> <span></span></label><div class="knobs" hidden></div>';
    root.querySelector("span").textContent = title;
    const box = root.querySelector("input");
    const inside = root.querySelector(".knobs");
    const sliders = knobs.map((signal) => [signal.name,
      slider(signal, signal.start, (si) => this.command({ disturbances: { [key]: { [signal.name]: si } } }), this.refuse)]);
    inside.append(...sliders.map(([, s]) => s.root));
    box.addEventListener("change", () => {
      const values = Object.fromEntries(knobs.map((signal) => [signal.name, signal.start]));
      this.command({ disturbances: { [key]: box.checked ? values : null } });
    });
    this.boxes.disturbances.append(root);
    return { key, box, inside, sliders };
  }

  // Show what holds; `anew` puts refused numbers back, too.
  show(state, anew = false) {
    if (state.law !== this.law) {
      this.law = state.law;
      for (const button of this.boxes.laws.children) button.setAttribute("aria-pressed", button.value === state.law);
      const law = state.law;
      this.sliders = Object.fromEntries(this.about.laws[law].references.map((signal) => [signal.name,
        slider(signal, state.references[signal.name], (si) => this.command({ law, references: { [signal.name]: si } }), this.refuse)]));
      this.boxes.references.replaceChildren(...Object.values(this.sliders).map((s) => s.root));
    }
    for (const [name, s] of Object.entries(this.sliders)) {
      if (anew || !s.busy()) s.set(state.references[name]);
    }
    for (const { key, box, inside, sliders } of this.switches) {
      const on = state.disturbances[key];
      box.checked = Boolean(on);
      inside.hidden = !on;
      for (const [name, s] of sliders) if (on && (anew || !s.busy())) s.set(on[name]);
    }
  }
}
