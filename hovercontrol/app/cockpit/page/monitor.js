// The monitor: what has changed in the craft, how large, since when, and what else it may be.
import { shown } from "/page/units.js";

const HINT = "A filter that knows the craft and looks for changes. Switch it on, then a disturbance.";

function number(value, digits) {
  return value.toFixed(digits).replace("-", "\u2212");
}

// One alarm as a sentence: the size in the unit of the page, with its standard error.
export function sentence(alarm) {
  const name = alarm.name.replaceAll("_", " ");
  if (alarm.kind === "dead") return `no samples of ${name} since ${alarm.since.toFixed(1)} s`;
  const { text, factor } = shown(alarm.unit);
  const std = alarm.std * factor;
  const digits = Math.min(4, Math.max(0, 1 - Math.floor(Math.log10(std))));
  const size = `${number(alarm.change * factor, digits)} ± ${number(std, digits)} ${text}`.trim();
  const rivals = alarm.rivals.map((rival) => rival.replaceAll("_", " "));
  const or = rivals.length ? `; or it is ${rivals.join(" or ")}` : "";
  return `${name} changed by ${size} since ${alarm.since.toFixed(1)} s${or}`;
}

export class Monitor {
  constructor({ button, now, evidence, alarms }, order) {
    Object.assign(this, { button, now, evidence, alarms });
    button.addEventListener("click", () => order(button.getAttribute("aria-pressed") !== "true"));
  }

  show(state) {
    const found = state.monitor;
    this.button.setAttribute("aria-pressed", found !== null);
    this.button.textContent = found ? "Stop watching" : "Watch";
    this.button.disabled = !state.pilot || (state.loop !== "ideal" && !found);
    this.button.title = state.loop === "ideal" ? "" : "The monitor knows the ideal loop only.";
    this.evidence.hidden = found === null;
    if (!found) {
      this.set(this.now, HINT);
      this.list([]);
      return;
    }
    const { evidence, threshold } = found;
    this.evidence.value = evidence / threshold;
    this.now.classList.toggle("alarm", found.open !== null);
    const since = found.begun === null ? 0 : state.signals.time - found.begun;
    const last = found.alarms.at(-1);
    const calm = last ? "No further change." : `Nothing has changed in ${since.toFixed(0)} s.`;
    this.set(this.now, found.open ? `Changing: ${sentence(found.open)}.` : calm);
    this.list(found.alarms.map((alarm) => `${alarm.time.toFixed(1)} s: ${sentence(alarm)}.`));
  }

  set(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }

  list(texts) {
    const told = texts.join("\n");
    if (told === this.told) return;
    this.told = told;
    this.alarms.replaceChildren(...texts.map((text) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }).reverse());
  }
}
