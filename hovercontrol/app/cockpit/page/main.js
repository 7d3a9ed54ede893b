// The page of the cockpit: frames from the server are drawn, orders of the pilot are sent.
import { Gauges } from "/page/gauges.js";
import { CraftMap } from "/page/map.js";
import { Monitor } from "/page/monitor.js";
import { Panel } from "/page/panel.js";
import { Replay } from "/page/replay.js";
import { Station } from "/page/station.js";
import { Stick } from "/page/stick.js";

const at = (id) => document.getElementById(id);
let socket = null;
let state = null; // the last frame
let fresh = false; // it has not been drawn yet
let lastTime = 0;
let seen = { frames: 0, drawn: 0 }; // for tests, and for the curious
globalThis.cockpit = { seen: () => ({ ...seen, state }) };

const send = (message) => socket?.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const map = new CraftMap(at("map"), {
  onGoal: (x, y) => send({ command: { law: "goal", references: { goal_x_ref: x, goal_y_ref: y } } }),
});
const gauges = new Gauges(at("gauges"));
const panel = new Panel(at("laws"), at("references"), at("disturbances"), (command) => send({ command }), (text) => {
  say(text);
  panel.show(state, true);
});
const station = new Station(at("station"), (command) => send({ command }));
const monitor = new Monitor(
  { button: at("monitor"), now: at("monitor-now"), evidence: at("monitor-evidence"), alarms: at("monitor-alarms") },
  (on) => send({ monitor: on }),
);
const replay = new Replay({ play: at("play"), seek: at("seek"), speed: at("speed") });
const stick = new Stick(at("pad"), at("knob"), () => {
  if (state?.pilot && !byStick(state.law)) say(`The stick is off: ${title(state.law)} flies. Choose Manual.`, true);
});
const title = (law) => map.about.laws[law].title;
const byStick = (law) => map.about.laws[law].stick;

let hush = 0;
function say(text, news = false, seconds = 6) {
  at("message").textContent = text;
  at("message").hidden = !text;
  at("message").classList.toggle("news", news);
  clearTimeout(hush);
  if (text && seconds) hush = setTimeout(() => say(""), 1000 * seconds);
}

// ---- the server ------------------------------------------------------------------------------------

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
  socket.addEventListener("message", (event) => hear(JSON.parse(event.data)));
  socket.addEventListener("close", () => {
    state = null;
    status("not connected: is hovercontrol cockpit running?", true);
    setTimeout(connect, 1000);
  });
}

function hear(message) {
  if ("frame" in message) return hearFrame(message);
  if ("about" in message) return begin(message);
  if ("error" in message) {
    say(message.error);
    if (state) panel.show(state, true);
  }
  if ("news" in message) say(message.news, true, message.wait ? 120 : 4);
  if ("saved" in message) {
    say(`Saved ${message.saved}, ${message.seconds.toFixed(1)} s.`, true);
    listLogs(message.saved);
  }
}

function begin({ about, replay: given }) {
  const known = map.about?.craft === about.craft;
  map.about = about;
  if (!known) map.scale = 27 / about.arm;
  at("craft").textContent = about.craft;
  document.body.dataset.loop = about.loop;
  for (const button of at("loops").children) button.setAttribute("aria-pressed", button.value === about.loop);
  at("loops").title = about.real ? "" : "The real loop needs a craft whose thrust is in newton.";
  gauges.build(about);
  panel.build(about);
  map.clearTrail();
  listLogs();
  if (given && !known) open("/replay");
}

// Every frame is answered, so that the server knows that the pilot is there; this goes on in a hidden tab.
function hearFrame(message) {
  seen.frames += 1;
  state = message;
  fresh = true;
  const value = stick.update();
  if (state.pilot) send({ stick: value });
  if (state.signals.time < lastTime) map.clearTrail();
  lastTime = state.signals.time;
  map.addToTrail(state.signals);
}

// ---- what is shown ---------------------------------------------------------------------------------

function status(text, bad = false) {
  if (at("status").textContent === text) return;
  at("status").textContent = text;
  at("status").classList.toggle("bad", bad);
}

function draw() {
  requestAnimationFrame(draw);
  if (replay.columns) {
    const signals = replay.signals();
    at("time").textContent = signals.time === undefined ? "" : replay.now.toFixed(1);
    map.draw(signals, null, replay.path);
    gauges.show(signals);
    return;
  }
  if (!state) return;
  map.picksGoal = state.law === "goal" && state.pilot;
  at("map").classList.toggle("goal", map.picksGoal);
  map.draw(state.signals, state.law);
  if (!fresh) return;
  fresh = false;
  seen.drawn += 1;
  gauges.show(state.signals);
  panel.show(state);
  station.show(state, map.about);
  monitor.show(state);
  at("time").textContent = state.signals.time.toFixed(1);
  at("pause").textContent = state.paused ? "Go on" : "Pause";
  const recording = state.recording !== null;
  at("record").setAttribute("aria-pressed", recording);
  at("record").textContent = recording ? `Stop recording (${state.recording.toFixed(0)} s)` : "Record";
  at("take").hidden = state.pilot;
  for (const id of ["pause", "reset", "record"]) at(id).disabled = !state.pilot;
  for (const button of at("loops").children) button.disabled = !state.pilot || !map.about.real;
  at("stick-panel").classList.toggle("off", !byStick(state.law) || !state.pilot);
  at("mode").textContent = modeText();
  showStatus();
}

function modeText() {
  const parts = Object.entries(state.modes).map(([name, names]) =>
    `${name === "mode" ? "step" : name.replace("_", " ")}: ${names[state.signals[name]] ?? ""}`);
  const hint = state.law === "goal" ? ["click on the map to set the goal"] : [];
  if (Object.keys(map.about.laws).length === 1) hint.push("K06's laws need a craft whose thrust is in newton.");
  return [...hint, ...parts].join(" · ");
}

let paceShown = -Infinity;
function showStatus() {
  const pace = state.factor === null ? "" : `${Math.round(100 * state.factor)} % of real time, ${Math.round(100 * state.load)} % of one core`;
  if (!state.pilot) status("you are watching: another page flies", true);
  else if (state.slow) status(`this machine is too slow: ${pace}`, true);
  else if (state.note) status(state.note, true);
  else if (state.paused) status("paused");
  else if (performance.now() - paceShown > 700) { // numbers that stand still can be read
    paceShown = performance.now();
    status(pace || "flying");
    return;
  } else return;
  paceShown = -Infinity;
}

// ---- logs ------------------------------------------------------------------------------------------

async function listLogs(chosen = "") {
  const names = await (await fetch("/logs")).json();
  const select = at("logs");
  chosen ||= select.value;
  select.replaceChildren(...(names.length ? names : [""]).map((name) => new Option(name || "none yet", name)));
  if (names.length) select.value = names.includes(chosen) ? chosen : names.at(-1);
  chooseLog();
}

function chooseLog() {
  const name = at("logs").value;
  at("replay").disabled = !name;
  if (name) at("download").href = `/logs/${encodeURIComponent(name)}`;
  else at("download").removeAttribute("href");
}

async function open(address, options) {
  const answer = await fetch(address, options);
  if (!answer.ok) return say(await answer.text(), false, 15);
  send({ pause: true });
  document.body.dataset.mode = "replay";
  at("player").hidden = false;
  const log = await answer.json();
  replay.open(log);
  map.setFollow(true);
  status(`replay of ${log.name}`);
  say("");
}

at("replay").addEventListener("click", () => open(`/logs/${encodeURIComponent(at("logs").value)}/columns`));
at("upload").addEventListener("change", () => {
  const [file] = at("upload").files;
  if (file) open(`/upload?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
  at("upload").value = "";
});
at("live").addEventListener("click", () => {
  replay.close();
  document.body.dataset.mode = "live";
  at("player").hidden = true;
  fresh = true;
});
at("logs").addEventListener("change", chooseLog);
for (const id of ["logs", "speed"]) at(id).addEventListener("change", () => at(id).blur());

// ---- buttons ---------------------------------------------------------------------------------------

at("pause").addEventListener("click", () => send({ pause: !state.paused }));
at("reset").addEventListener("click", () => send({ reset: true }));
at("record").addEventListener("click", () => send({ record: state.recording === null }));
for (const button of at("loops").children) button.addEventListener("click", () => send({ loop: button.value }));
at("take").addEventListener("click", () => send({ take: true }));
at("nearer").addEventListener("click", () => map.zoom(1.25));
at("farther").addEventListener("click", () => map.zoom(0.8));
at("follow").addEventListener("click", () => map.setFollow(!map.follow));
map.onFollow = (on) => at("follow").setAttribute("aria-pressed", on);

connect();
draw();
