import { describe, frames, limitsInWords, remember, roomiest, tidy, toolPose } from "./chain.js";
import { toC, toPython } from "./code.js";
import { Handles } from "./handles.js";
import { fromHash, toHash } from "./link.js";
import { movedTo, plus, position, scaled, turned, wrapped } from "./matrices.js";
import { describeOwn } from "./own.js";
import { Pace } from "./pace.js";
import { Panel, intervalText } from "./panel.js";
import { Plot } from "./plot.js";
import { Camera, Stage } from "./stage.js";

const KEYS = { step: 0.01, fine: 0.001, turn: Math.PI / 36, fineTurn: Math.PI / 360, orbit: 0.1 }; // [m], [rad]
const JUMP = { least: 0.3, time: 350 }; // [rad] from which on the arm is seen to move, for so long [ms]
const TEXTS = { fine: 150, coarse: 400 }; // [ms] between changes of the texts while things move
const REST = 250; // [ms] without a change: finer curves, the address, words for screen readers
const GHOSTS = 8; // of a curve
const ARRIVED = 1e-5; // [m], and parts of rotations: where the tool is at its target
const COLOURS = {
  light: { within: [0.0, 0.5, 0.6], outside: [0.85, 0.4, 0.05] },
  dark: { within: [0.3, 0.8, 0.85], outside: [1.0, 0.6, 0.25] },
};
const HANDLES = {
  light: { axes: ["#c62828", "#2e7d32", "#1e5fc2"], halo: "rgb(255 255 255 / 0.85)", dot: "#333a45" },
  dark: { axes: ["#ff7b72", "#6fd07a", "#7fb2ff"], halo: "rgb(20 22 28 / 0.85)", dot: "#e8ebf0" },
};

class Playground {
  camera = new Camera();
  pace = new Pace();
  robot = null;
  q = null; // [rad], where the arm is, or goes
  shown = null; // [rad], how it is drawn
  pose = null; // of the target
  free = null;
  answer = null; // to the last question
  looked = null; // index of the solution under the pointer
  outside = true;
  plotted = 0;

  #asked = 0;
  #waiting = null; // the question that is next
  #busy = false;
  #drawn = false; // whether a frame is on its way
  #rest;
  #jump = null;
  #still = true; // nothing moves: all pixels are drawn
  #written = 0; // when the texts last changed [ms]
  #opening = []; // who waits for a solver file to be read
  #settled = []; // who waits for the page to be at rest

  constructor(root, names) {
    this.names = names;
    this.panel = new Panel(root, names, {
      robot: (name) => this.load(name),
      open: (file) => this.open(file),
      free: (axis) => this.setFree(axis),
      frame: (frame) => ((this.handles.frame = frame), this.redraw()),
      home: () => this.setJoints(this.robot.home),
      pose: (pose) => this.setPose(pose),
      joint: (joint, angle) => this.#setJoint(joint, angle),
      nudge: (joint, step) => this.#setJoint(joint, this.q[joint] + step),
      choose: (index) => this.choose(index),
      look: (index) => ((this.looked = index), this.redraw()),
      outside: (shown) => ((this.outside = shown), this.redraw(), this.#list()),
      plotted: (joint) => ((this.plotted = joint), this.#plot()),
      slide: (point) => this.#slide(point),
      copy: (what) => this.#copy(what),
    });
    this.stage = new Stage(this.panel.canvas);
    this.handles = new Handles(this.panel.canvas, this.panel.handles);
    this.plot = new Plot(this.panel.figure, (q) => this.take(q));
    this.worker = new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
    this.worker.onmessage = ({ data }) => (data.id === undefined ? this.#opening.shift()(data) : this.#answered(data));
    this.worker.onerror = (event) => this.#failed(event.message);
    listen(this);
  }

  get dof() {
    return this.robot.joints.length;
  }

  get dark() {
    return document.body.dataset.mdColorScheme === "slate";
  }

  /** Show a robot, at home or as an address has it. */
  async load(name, { q = null, pose = null, free = null } = {}) {
    const robot = await describe(name);
    this.stage.add(robot);
    if (this.robot?.name !== name) this.camera.show(robot.reach);
    this.robot = robot;
    this.answer = null;
    this.looked = null;
    this.#jump = null;
    this.panel.setRobot(robot);
    this.plotted = robot.lower.findIndex(Number.isFinite);
    if (this.plotted < 0) this.plotted = 0;
    this.panel.plotted.value = this.plotted;
    const start = q?.length === this.dof ? q : robot.home;
    this.q = start.map((angle, i) => Math.min(Math.max(angle, robot.lower[i]), robot.upper[i]));
    this.shown = this.q;
    this.free = this.dof === 7 ? null : free;
    this.panel.free.value = this.free ?? "";
    this.setPose(pose ?? toolPose(robot, this.q));
  }

  /** Show an arm of one's own, by a file that `jacokin export-c` wrote. It goes nowhere. */
  async open(file) {
    const name = file.name.replace(/(\.jacokin)?$/, ".jacokin"); // no bundled robot is called so
    const contents = await file.arrayBuffer();
    const { opened, error } = await new Promise((resolve) => {
      this.#opening.push(resolve);
      this.worker.postMessage({ robot: name, file: contents });
    });
    if (error) return this.panel.showStatus(false, `${file.name} is not opened: ${error}`);
    const robot = describeOwn(name, opened);
    remember(robot);
    await this.load(name);
  }

  setFree(axis) {
    this.free = axis;
    this.answer = null;
    this.setPose(toolPose(this.robot, this.q));
  }

  /** Ask the arm to reach a pose. */
  setPose(pose) {
    this.pose = pose;
    this.#ask(false);
    this.redraw();
  }

  /** Put the arm into a configuration; the target goes with it. */
  setJoints(q) {
    this.#moveTo(q);
    this.setPose(toolPose(this.robot, q));
  }

  #setJoint(joint, angle) {
    const from = this.q[joint];
    const { lower, upper } = this.robot;
    const near = Number.isFinite(lower[joint]) ? angle : from + wrapped(angle - from);
    const to = Math.min(Math.max(near, lower[joint]), upper[joint]);
    this.setJoints(this.q.map((each, i) => (i === joint ? to : each)));
  }

  /** Take another solution of the same target. */
  take(q) {
    this.#moveTo(tidy(this.robot, q));
    this.#ask(false);
    this.redraw();
  }

  choose(index) {
    const { branches, curves } = this.answer ?? { branches: [], curves: [] };
    if (branches[index]?.withinLimits) this.take(branches[index].q);
    const best = roomiest(this.robot, curves[index]?.q ?? []);
    if (best) this.take(best);
  }

  /** Resolves once every question is answered and the page is at rest. */
  settled() {
    if (this.#still && this.answer) return Promise.resolve();
    return new Promise((resolve) => this.#settled.push(resolve));
  }

  /** What the page shows, for the address, the programs that are copied, and tests. */
  state() {
    const { robot, dof, q, pose, free, answer } = this;
    const own = robot.own ? { base: robot.base, tip: robot.frame } : null;
    const numbers = { q: Array.from(q), pose: Array.from(pose) };
    return { robot: robot.name, own, dof, ...numbers, free, answer, arrived: this.arrived };
  }

  /** Whether the tool is at the target, as it stands. */
  get arrived() {
    return toolPose(this.robot, this.q).every((value, i) => Math.abs(value - this.pose[i]) < ARRIVED);
  }

  // --- Questions and answers ------------------------------------------------------------------------------------------

  #ask(fine) {
    const { robot, pose, q, free } = this;
    this.#still = false;
    this.#waiting = { robot: robot.name, pose: Array.from(pose), seed: Array.from(q), free, fine };
    clearTimeout(this.#rest);
    if (!this.#busy) this.#send();
  }

  #send() {
    if (this.#waiting === null) return;
    this.#busy = true;
    this.worker.postMessage({ id: ++this.#asked, ...this.#waiting });
    this.current = this.#waiting;
    this.#waiting = null;
  }

  #answered(data) {
    this.#busy = false;
    const fine = this.current.fine;
    const about = this.current.robot === this.robot.name && this.current.free === this.free;
    if (data.error) return this.#failed(data.error);
    if (about) {
      this.answer = data;
      if (data.q && !fine) this.#moveTo(Array.from(data.q));
      this.redraw();
      if (fine) this.#list();
    }
    this.#send();
    if (!this.#busy) {
      clearTimeout(this.#rest);
      if (fine) this.#atRest();
      else this.#rest = setTimeout(() => this.#ask(true), REST);
    }
  }

  #failed(message) {
    this.#busy = false;
    this.panel.showStatus(false, `The solver failed: ${message}`);
  }

  #atRest() {
    this.#still = true;
    this.redraw();
    this.#list();
    if (!this.robot.own) history.replaceState(null, "", this.#hash());
    this.panel.say(this.panel.status.textContent);
    for (const resolve of this.#settled.splice(0)) resolve();
  }

  #hash() {
    const { robot, q, pose, free } = this;
    return toHash({ robot: robot.name, q: tidy(robot, q), free, pose: this.arrived ? null : pose });
  }

  // --- Drawing -------------------------------------------------------------------------------------------------------

  redraw() {
    if (this.#drawn || !this.robot) return;
    this.#drawn = true;
    requestAnimationFrame((now) => this.#frame(now));
  }

  /** Draw what moves without the arm. */
  stir() {
    this.#still = false;
    clearTimeout(this.#rest);
    this.#rest = setTimeout(() => this.#ask(true), REST);
    this.redraw();
  }

  #frame(now) {
    this.#drawn = false;
    this.#advance(now);
    const { canvas } = this.panel;
    const { clientWidth: width, clientHeight: height } = canvas;
    const sharpness = this.pace.sharpness(now, this.#still);
    resize(canvas, width * sharpness, height * sharpness);
    this.camera.aspect = width / height;
    const dark = this.dark;
    const places = frames(this.robot, this.shown);
    const coarse = this.pace.coarse && !this.#still;
    this.panel.setCoarse(coarse);
    this.stage.draw(this.camera, { robot: this.robot, places, dark, ghosts: this.#ghosts(), coarse });
    const ratio = Math.min(Math.ceil(globalThis.devicePixelRatio), 2);
    this.handles.draw(this.camera, this.pose, { colours: HANDLES[dark ? "dark" : "light"], ratio });
    if (!this.#still && now - this.#written < TEXTS[coarse ? "coarse" : "fine"]) return;
    this.#written = now;
    this.panel.showJoints(this.q);
    this.panel.showPose(this.pose);
    if (!this.#still) this.#list();
  }

  #moveTo(q) {
    this.q = q;
    const { lower } = this.robot;
    this.shown = this.shown.map((angle, i) => (Number.isFinite(lower[i]) ? angle : q[i] + wrapped(angle - q[i])));
    if (this.#jump && farthest(q, this.#jump.to) < JUMP.least) {
      this.#jump.to = q; // it is on its way there
      return;
    }
    const far = farthest(q, this.shown);
    if (far < JUMP.least || matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.#jump = null;
      this.shown = q;
    } else {
      this.#jump = { from: this.shown, to: q, start: performance.now() };
    }
  }

  #advance(now) {
    if (!this.#jump) return;
    const { from, to, start } = this.#jump;
    const t = Math.min(Math.max((now - start) / JUMP.time, 0), 1);
    const part = t * t * (3 - 2 * t);
    this.shown = to.map((angle, i) => from[i] + (angle - from[i]) * part);
    if (t === 1) this.#jump = null;
    else queueMicrotask(() => this.redraw());
  }

  #ghosts() {
    if (!this.answer) return [];
    const colours = COLOURS[this.dark ? "dark" : "light"];
    const ghost = (q, kind, index) => ({
      places: frames(this.robot, q),
      colour: [...colours[kind], index === this.looked ? 0.75 : kind === "within" ? 0.3 : 0.22],
    });
    const { branches, curves } = this.answer;
    const single = branches.flatMap(({ q, withinLimits }, index) => {
      if (this.#isHere(q) || !(withinLimits || this.outside)) return [];
      return [ghost(q, withinLimits ? "within" : "outside", index)];
    });
    const whole = curves.reduce((sum, { start, stop }) => sum + stop - start, 0);
    const swept = curves.flatMap(({ q, start, stop }, index) => {
      const count = Math.max(1, Math.round((GHOSTS * (stop - start)) / (whole || 1)));
      return Array.from({ length: count }, (_, i) => q[Math.floor(((i + 0.5) * q.length) / count)])
        .filter((point) => point && !this.#isHere(point))
        .map((point) => ghost(point, "within", index));
    });
    return [...single, ...swept];
  }

  #isHere(q) {
    return q.every((angle, i) => Math.abs(Math.sin((angle - this.q[i]) / 2)) < 1e-3);
  }

  // --- Texts ---------------------------------------------------------------------------------------------------------

  #list() {
    if (!this.answer) return;
    const { branches, curves, status, message, complete } = this.answer;
    const sets = this.dof === 7 || this.free;
    this.panel.outsideLabel.hidden = Boolean(sets);
    const items = sets
      ? curves.map((curve) => ({
          kind: curve === this.#curveHere() ? "here" : "within",
          ...intervalText(this.robot, this.#parameterName(), curve),
        }))
      : branches.map(({ q, withinLimits }) => ({
          kind: this.#isHere(q) ? "here" : withinLimits ? "within" : "outside",
          text: withinLimits ? "within the limits" : "outside the limits",
          more: limitsInWords(this.robot, q),
        }));
    const within = branches.filter((branch) => branch.withinLimits).length;
    const title = sets
      ? `Solutions: ${counted(curves.length, "interval")}${complete ? "" : ", perhaps more"}`
      : `Solutions: ${branches.length}, ${within} within the limits`;
    this.panel.showSolutions(title, items);
    const good = status === "ok";
    const here = limitsInWords(this.robot, this.q);
    this.panel.showStatus(good, good ? `Reached: ${here}.` : `${capital(message)}.`);
    this.#plot();
  }

  #plot() {
    const sets = this.robot && (this.dof === 7 || this.free);
    this.panel.figure.hidden = !sets;
    if (!sets || !this.answer) return;
    const { curves, parameter } = this.answer;
    const name = this.#parameterName();
    this.plot.draw({ robot: this.robot, joint: this.plotted, curves, q: this.q, parameter, name });
    const here = this.#curveHere();
    this.panel.slider.disabled = !here;
    this.panel.sliderLabel.textContent = `Along it: ${name} `;
    if (!here) return;
    this.panel.slider.max = here.q.length - 1;
    if (document.activeElement !== this.panel.slider) this.panel.slider.value = nearestPoint(here.q, this.q).index;
    const at = parameter ?? here.start;
    this.panel.slider.setAttribute("aria-valuetext", `${((at * 180) / Math.PI).toFixed(1)} degrees`);
  }

  #slide(point) {
    const q = this.#curveHere()?.q[point];
    if (q) this.take(q);
  }

  /** The curve on which the arm is. */
  #curveHere() {
    const distances = this.answer.curves.map(({ q }) => nearestPoint(q, this.q).distance);
    return this.answer.curves[distances.indexOf(Math.min(...distances))] ?? null;
  }

  #parameterName() {
    return this.free ? `angle about ${this.free}` : this.robot.joints[this.answer.joint];
  }

  async #copy(what) {
    const texts = {
      link: () => location.href.split("#")[0] + this.#hash(),
      python: () => toPython(this.state()),
      c: () => toC(this.state()),
    };
    const text = texts[what]();
    try {
      await navigator.clipboard.writeText(text);
      this.panel.copied.textContent = "Copied.";
      setTimeout(() => (this.panel.copied.textContent = ""), 2000);
    } catch {
      this.panel.showText(text);
    }
  }
}

// --- Pointer and keys ------------------------------------------------------------------------------------------------

function listen(page) {
  const { camera, handles } = page;
  const { canvas } = page.panel;
  let dragging = null; // from a pixel to a pose
  let turning = null; // the last pixel

  const pixel = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const look = (event) => {
    const found = page.robot && handles.at(camera, page.pose, ...pixel(event), event.pointerType);
    canvas.style.cursor = found ? "grab" : "default";
    if (JSON.stringify(found) === JSON.stringify(handles.active)) return;
    handles.active = found;
    page.redraw();
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (!page.robot || event.button !== 0) return;
    look(event);
    canvas.setPointerCapture(event.pointerId);
    if (handles.active) dragging = handles.drag(handles.active, camera, page.pose, ...pixel(event));
    else turning = pixel(event);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (dragging) page.setPose(dragging(...pixel(event)));
    else if (turning) {
      const [x, y] = pixel(event);
      camera.turnTo(camera.azimuth - (x - turning[0]) * 0.008, camera.elevation + (y - turning[1]) * 0.008);
      turning = [x, y];
      page.stir();
    } else look(event);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, () => {
      dragging = turning = null;
    });
  }
  canvas.addEventListener("pointerleave", () => {
    if (dragging) return;
    handles.active = null;
    page.redraw();
  });
  // A finger on a handle drags it; elsewhere it may scroll the page.
  canvas.addEventListener(
    "touchstart",
    (event) => {
      const box = canvas.getBoundingClientRect();
      const [x, y] = [event.touches[0].clientX - box.left, event.touches[0].clientY - box.top];
      if (page.robot && handles.at(camera, page.pose, x, y, "touch")) event.preventDefault();
    },
    { passive: false },
  );
  // The wheel scrolls the page unless the arm was clicked before.
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas) return;
      event.preventDefault();
      zoom(page, Math.exp(event.deltaY * 0.001));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => press(page, event));
  canvas.addEventListener("dragover", (event) => event.preventDefault());
  canvas.addEventListener("drop", (event) => {
    event.preventDefault();
    for (const file of event.dataTransfer.files) page.open(file);
  });
  globalThis.addEventListener("hashchange", () => page.load(...stateOf(location.hash, page.names)));
  globalThis.addEventListener("resize", () => page.redraw());
  new ResizeObserver(() => page.redraw()).observe(canvas);
  const repaint = new MutationObserver(() => page.redraw());
  repaint.observe(document.body, { attributeFilter: ["data-md-color-scheme"] });
}

function zoom(page, factor) {
  page.camera.distance = Math.min(Math.max(page.camera.distance * factor, 0.5), 6);
  page.redraw();
}

function press(page, event) {
  if (!page.robot || event.ctrlKey || event.metaKey) return;
  const { camera } = page;
  const move = movement(page, event);
  const actions = {
    "+": () => zoom(page, 0.9),
    "-": () => zoom(page, 1.1),
    "[": () => (camera.turnTo(camera.azimuth - KEYS.orbit, camera.elevation), page.redraw()),
    "]": () => (camera.turnTo(camera.azimuth + KEYS.orbit, camera.elevation), page.redraw()),
    Home: () => page.setJoints(page.robot.home),
  };
  if (move) page.setPose(move);
  else if (/^[1-9]$/.test(event.key)) page.choose(Number(event.key) - 1);
  else if (actions[event.key]) actions[event.key]();
  else return;
  event.preventDefault();
}

/** The pose that a key leads to; null for other keys. Arrows go along the axes that look right, and away. */
function movement(page, { key, shiftKey, altKey }) {
  const directions = page.handles.directions(page.pose);
  const [right, , back] = page.camera.axes;
  const along = (wanted, among) => {
    const found = among.map((axis) => axis[0] * wanted[0] + axis[1] * wanted[1] + axis[2] * wanted[2]);
    const best = found.reduce((a, value, i) => (Math.abs(value) > Math.abs(found[a]) ? i : a), 0);
    return { axis: scaled(among[best], Math.sign(found[best])), rest: among.filter((_, i) => i !== best) };
  };
  const up = along([0, 0, 1], directions);
  const across = along(right, up.rest);
  const away = along(scaled(back, -1), across.rest);
  const axes = {
    ArrowRight: [across.axis, 1], ArrowLeft: [across.axis, -1],
    ArrowUp: [away.axis, 1], ArrowDown: [away.axis, -1],
    PageUp: [up.axis, 1], PageDown: [up.axis, -1],
  };
  if (!axes[key]) return null;
  const [axis, sign] = axes[key];
  if (shiftKey) return turned(page.pose, axis, sign * (altKey ? KEYS.fineTurn : KEYS.turn));
  return movedTo(page.pose, plus(position(page.pose), scaled(axis, sign * (altKey ? KEYS.fine : KEYS.step))));
}

const farthest = (a, b) => Math.max(...a.map((angle, i) => Math.abs(angle - b[i])));

function nearestPoint(points, q) {
  let best = { index: 0, distance: Infinity };
  points.forEach((point, index) => {
    if (!point) return;
    const distance = Math.hypot(...point.map((angle, i) => Math.sin((angle - q[i]) / 2)));
    if (distance < best.distance) best = { index, distance };
  });
  return best;
}

function resize(canvas, width, height) {
  const [w, h] = [Math.max(1, Math.round(width)), Math.max(1, Math.round(height))];
  if (canvas.width !== w) canvas.width = w;
  if (canvas.height !== h) canvas.height = h;
}

const counted = (count, name) => `${count} ${name}${count === 1 ? "" : "s"}`;
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1).replace(/\.$/, "");

/** Arguments of `load` for an address. */
function stateOf(hash, names) {
  const { robot, ...state } = fromHash(hash, names);
  return [robot ?? names[0], state];
}

function begin() {
  const root = document.getElementById("pg-root");
  try {
    const page = new Playground(root, ROBOTS);
    globalThis.jacokinPlayground = page;
    page.load(...stateOf(location.hash, ROBOTS)).catch((error) => page.panel.showStatus(false, error.message));
  } catch (error) {
    root.textContent = `The playground does not run here: ${error.message}.`;
  }
}

begin();
