// The ground station of the real loop, grouped as K06's figure 5.2: what is known over the link, and its switches.
import { number, shown } from "/page/units.js";

const RPM = 60 / (2 * Math.PI);
const age = (name) => (s) => `${number(1000 * s[name], 0)} ms`;
const lost = (way) => (s) => `${number(s[`${way}_lost`], 0)} of ${number(s[`${way}_messages`], 0)}`;
const pair = (unit, digits, ...names) => (s) => {
  const { text, factor } = shown(unit);
  return `${names.map((name) => number(s[name] * factor, digits)).join(", ")} ${text}`;
};

function clock(s) {
  const seconds = Math.floor(s.power_on_time_received);
  const two = (value) => String(value).padStart(2, "0");
  return `${two(Math.floor(seconds / 3600))}:${two(Math.floor(seconds / 60) % 60)}:${two(seconds % 60)}`;
}

// title, switches, rows of label and text
const GROUPS = [
  ["Link", ["transmit"], [
    ["Power-on time", clock],
    ["Age of commands", age("uplink_age")],
    ["Packets lost, up", lost("uplink")],
    ["Age of data", age("downlink_age")],
    ["Packets lost, down", lost("downlink")],
  ]],
  ["Craft", ["lift", "calibrate"], [
    ["Platform roll", pair("rad", 2, "platform_roll_received")],
    ["Platform pitch", pair("rad", 2, "platform_pitch_received")],
    ["Fan", (s) => `${number(s.fan_speed_set * RPM, 0)} rpm`],
    ["Fan drive", (s) => (s.drive_mode ? "brakes" : "runs")],
    ["Hears commands", (s) => (s.failsafe_on ? "no, fans off" : "yes")],
  ]],
  ["Navigation", [], [
    ["Position x, y", pair("m", 2, "x_told_received", "y_told_received")],
    ["Heading", pair("rad", 1, "psi_told_received")],
    ["Yaw rate", pair("rad/s", 1, "r_told_received")],
    ["Velocity, body", pair("m/s", 2, "u_told_received", "v_told_received")],
    ["Velocity, inertial", pair("m/s", 2, "v_x_hat_received", "v_y_hat_received")],
    ["Specific force, body", pair("m/s^2", 2, "force_x_hat_received", "force_y_hat_received")],
    ["Specific force, inertial", pair("m/s^2", 2, "force_x_inertial_received", "force_y_inertial_received")],
    ["Gyro bias", pair("rad/s", 2, "gyro_bias_hat_received")],
    ["Accelerometer bias", pair("m/s^2", 3, "acceleration_x_bias_hat_received", "acceleration_y_bias_hat_received")],
  ]],
  ["Commands", ["user", "computer"], [
    ["Law", (s, state, about) => about.laws[state.law].title],
    ["Force x, y", pair("N", 2, "force_x", "force_y")],
    ["Thrust acting", pair("N", 2, "thrust")],
    ["Rudder acting", pair("rad", 1, "rudder")],
  ]],
];

const BUTTONS = { transmit: "Transmit", lift: "Lift", calibrate: "Calibrate", user: "User", computer: "Computer" };

export class Station {
  constructor(box, command) {
    this.box = box;
    this.computer = "stop"; // the law that flies when the computer is chosen
    this.rows = [];
    this.buttons = {};
    for (const [title, buttons, rows] of GROUPS) this.addGroup(title, buttons, rows, command);
  }

  addGroup(title, buttons, rows, command) {
    const group = document.createElement("section");
    group.className = "group";
    group.innerHTML = "<h2></h2><div class=\"buttons\"></div><dl></dl>";
    group.querySelector("h2").textContent = title;
    const [row, list] = [group.querySelector(".buttons"), group.querySelector("dl")];
    for (const key of buttons) {
      const button = document.createElement("button");
      button.type = "button";
      button.id = `switch-${key}`;
      button.textContent = BUTTONS[key];
      button.addEventListener("click", () => command(this.order(key)));
      row.append(button);
      this.buttons[key] = button;
    }
    row.hidden = !buttons.length;
    for (const [label, text] of rows) {
      const [line, name, value] = ["div", "dt", "dd"].map((kind) => document.createElement(kind));
      name.textContent = label;
      line.append(name, value);
      list.append(line);
      this.rows.push([value, text]);
    }
    this.box.append(group);
  }

  order(key) {
    if (key === "user") return { law: "manual" };
    if (key === "computer") return { law: this.computer };
    return { switches: { [key]: key === "calibrate" || !this.state.switches[key] } };
  }

  show(state, about) {
    this.state = state;
    this.box.hidden = state.loop !== "real";
    if (this.box.hidden) return;
    if (state.law !== "manual") this.computer = state.law;
    const pressed = { ...state.switches, user: state.law === "manual", computer: state.law !== "manual" };
    for (const [key, button] of Object.entries(this.buttons)) {
      button.setAttribute("aria-pressed", pressed[key]);
      button.disabled = !state.pilot || (key === "calibrate" && state.switches.calibrate);
    }
    this.buttons.transmit.textContent = `Transmit ${state.switches.transmit ? "on" : "off"}`;
    this.buttons.lift.textContent = `Lift ${state.switches.lift ? "on" : "off"}`;
    this.buttons.calibrate.textContent = state.switches.calibrate ? "Calibrating…" : "Calibrate";
    for (const [value, text] of this.rows) value.textContent = text(state.signals, state, about);
  }
}
