import { angleText, limitsInWords, roomiest } from "./chain.js";
import { AXES } from "./handles.js";
import { degrees, fromRpy, position, radians, toRpy, wrapped } from "./matrices.js";

/** Everything around the stage, as plain HTML: what is chosen, typed and read. */

const STEPS = { metre: 0.01, degree: 5 };
const TURNS = [
  ["", "is fixed"],
  ...AXES.map((axis) => [axis, `may turn about its ${axis}`]),
];

/** Make an element; properties whose names have a hyphen, and `role`, are attributes. */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role" || name === "for") made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

export class Panel {
  #robot;
  #joints = []; // { slider, output }
  #buttons = []; // of the solutions

  /**
   * @param {HTMLElement} root
   * @param {string[]} names of the robots
   * @param {object} told what to do: `robot`, `open`, `free`, `frame`, `home`, `pose`, `joint`, `nudge`, `choose`, `look`,
   *   `outside`, `plotted`, `slide`, `copy`
   */
  constructor(root, names, told) {
    this.told = told;
    this.robots = select(names.map((name) => [name, name]), told.robot);
    this.file = element("input", { type: "file", accept: ".jacokin", hidden: true, "aria-label": "A solver file" });
    this.file.onchange = () => {
      const [file] = this.file.files;
      if (file) told.open(file);
      this.file.value = ""; // the same one may be opened again
    };
    const own = element("button", { type: "button", textContent: "Open …", onclick: () => this.file.click() });
    own.title = "An arm of your own: a file that jacokin export-c wrote";
    this.free = select(TURNS, (axis) => told.free(axis || null));
    this.frame = select([["base", "the base"], ["tool", "the tool"]], told.frame);
    this.home = element("button", { type: "button", textContent: "Home", onclick: told.home });
    this.freeLabel = element("label", {}, "Tool ", this.free);
    const bar = element(
      "div",
      { className: "pg-bar" },
      element("label", {}, "Robot ", this.robots),
      own,
      this.file,
      this.freeLabel,
      element("label", {}, "Axes of ", this.frame),
      this.home,
    );

    this.canvas = element("canvas", {
      className: "pg-canvas",
      tabIndex: 0,
      role: "application",
      "aria-label": "The arm. Arrow keys, page up and page down move the tool, with shift they turn it.",
      "aria-describedby": "pg-keys",
    });
    this.handles = element("canvas", { className: "pg-handles", "aria-hidden": "true" });
    this.status = element("p", { className: "pg-status" });
    const stage = element("div", { className: "pg-stage" }, this.canvas, this.handles, this.status);

    this.place = ["x", "y", "z"].map((name) => this.#number(`${name} [m]`, STEPS.metre));
    this.turn = ["roll", "pitch", "yaw"].map((name) => this.#number(`${name} [°]`, STEPS.degree));
    const labels = [...this.place, ...this.turn].map(({ label }) => label);
    const tool = group("Tool in the base", element("div", { className: "pg-numbers" }, ...labels));
    this.jointList = element("div", { className: "pg-joints" });
    this.outside = element("input", { type: "checkbox", checked: true });
    this.outside.onchange = () => told.outside(this.outside.checked);
    this.outsideLabel = element("label", { className: "pg-check" }, this.outside, " show those outside");
    this.solutions = element("ol", { className: "pg-solutions" });
    this.solutionsTitle = element("legend", { textContent: "Solutions" });
    const found = element("fieldset", {}, this.solutionsTitle, this.outsideLabel, this.solutions);
    const side = element("div", { className: "pg-side" }, tool, group("Joints", this.jointList), found);

    this.plotted = select([], (index) => told.plotted(Number(index)));
    this.slider = element("input", { type: "range", min: 0, step: 1 });
    this.slider.oninput = () => told.slide(Number(this.slider.value));
    this.sliderLabel = element("span", {});
    this.figure = element("figure", { className: "pg-set", hidden: true });
    const shown = element("label", {}, "The set of solutions: ", this.plotted);
    const along = element("label", { className: "pg-slide" }, this.sliderLabel, this.slider);
    this.figure.append(element("figcaption", {}, shown, along));

    const copies = [["link", "Copy link"], ["python", "Copy as Python"], ["c", "Copy as C"]];
    const buttons = copies.map(([what, textContent]) =>
      element("button", { type: "button", textContent, onclick: () => told.copy(what) }),
    );
    [this.link] = buttons;
    this.share = element("div", { className: "pg-share" }, ...buttons);
    this.copied = element("span", { role: "status" });
    this.share.append(this.copied);
    this.text = element("textarea", { readOnly: true, rows: 20, cols: 70, "aria-label": "To copy" });
    const close = element("form", { method: "dialog" }, element("button", { textContent: "Close" }));
    this.dialog = element("dialog", {}, this.text, close);
    this.live = element("p", { className: "pg-live", role: "status" });
    const main = element("div", { className: "pg-main" }, stage, side);
    root.replaceChildren(bar, main, this.figure, this.share, this.dialog, this.live);
  }

  /** Make what depends on the robot. */
  setRobot(robot) {
    this.#robot = robot;
    if (![...this.robots.options].some(({ value }) => value === robot.name)) this.robots.add(new Option(robot.name));
    this.robots.value = robot.name;
    this.link.hidden = Boolean(robot.own); // another page does not have its file
    this.freeLabel.hidden = robot.joints.length === 7;
    this.#joints = robot.joints.map((name, joint) => {
      const limited = Number.isFinite(robot.lower[joint]);
      const [min, max] = limited ? [degrees(robot.lower[joint]), degrees(robot.upper[joint])] : [-180, 180];
      const slider = element("input", { type: "range", min, max, step: "any" });
      slider.oninput = () => this.told.joint(joint, radians(Number(slider.value)));
      slider.onkeydown = (event) => {
        const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: 10, PageDown: -10 }[event.key];
        if (!step) return; // a slider without steps moves by too much
        event.preventDefault();
        this.told.nudge(joint, radians(step));
      };
      return { slider, output: element("output", {}) };
    });
    this.jointList.replaceChildren(
      ...this.#joints.map(({ slider, output }, joint) =>
        element("label", {}, element("span", { textContent: robot.joints[joint] }), slider, output),
      ),
    );
    const options = robot.joints.map((name, joint) => element("option", { value: joint, textContent: name }));
    this.plotted.replaceChildren(...options);
  }

  /** Without round corners, for which browsers without a graphics card draw the whole stage once more. */
  setCoarse(coarse) {
    this.canvas.parentElement.classList.toggle("pg-coarse", coarse);
  }

  /** What is typed is left alone. */
  showPose(pose) {
    const typed = document.activeElement;
    const values = [...position(pose), ...toRpy(pose).map(degrees)];
    [...this.place, ...this.turn].forEach(({ input }, i) => {
      if (input !== typed) input.value = values[i].toFixed(i < 3 ? 4 : 2);
    });
  }

  showJoints(q) {
    this.#joints.forEach(({ slider, output }, joint) => {
      const limited = Number.isFinite(this.#robot.lower[joint]);
      const angle = limited ? q[joint] : wrapped(q[joint]);
      slider.value = degrees(angle);
      slider.setAttribute("aria-valuetext", angleText(angle));
      change(output, angleText(angle));
    });
  }

  /** @param {{ kind: "here" | "within" | "outside", text: string, more: string }[]} items */
  showSolutions(title, items) {
    this.solutionsTitle.textContent = title;
    while (this.#buttons.length < items.length) this.#addButton();
    this.#buttons.forEach(({ item, button, text, more }, i) => {
      item.hidden = i >= items.length;
      if (item.hidden) return;
      change(text, items[i].text);
      change(more, items[i].more);
      item.className = `pg-${items[i].kind}`;
      button.setAttribute("aria-current", items[i].kind === "here");
      button.setAttribute("aria-disabled", items[i].kind === "outside");
    });
  }

  showStatus(good, text) {
    change(this.status, text);
    this.status.classList.toggle("pg-bad", !good);
  }

  /** Words for those who do not see the page; said once it is at rest. */
  say(text) {
    change(this.live, text);
  }

  /** What the clipboard did not take, to be copied by hand. */
  showText(text) {
    this.text.value = text;
    this.dialog.showModal();
    this.text.select();
  }

  #addButton() {
    const index = this.#buttons.length;
    const text = element("span", {});
    const more = element("small", {});
    const button = element("button", { type: "button" }, text, more);
    button.onclick = () => this.told.choose(index);
    button.onpointerenter = button.onfocus = () => this.told.look(index);
    button.onpointerleave = button.onblur = () => this.told.look(null);
    const item = element("li", {}, button);
    this.solutions.append(item);
    this.#buttons.push({ item, button, text, more });
  }

  #number(name, step) {
    const input = element("input", { type: "number", step });
    input.oninput = () => {
      const values = [...this.place, ...this.turn].map((each) => each.input.valueAsNumber);
      if (values.every(Number.isFinite)) this.told.pose(fromRpy(values.slice(0, 3), values.slice(3).map(radians)));
    };
    return { input, label: element("label", {}, name, input) };
  }
}

/** What an interval of solutions says of itself. */
export function intervalText(robot, name, { start, stop, ends, joints, q }) {
  const best = roomiest(robot, q);
  const more = best ? `at best ${limitsInWords(robot, best)}` : "";
  if (ends[0] === "circle") return { text: `${name}: full circle`, more };
  const why = (end, joint) => (end === "limit" && joint !== null ? `limit of ${robot.joints[joint]}` : end);
  const reasons = `ends by ${why(ends[0], joints[0])} and ${why(ends[1], joints[1])}`;
  return { text: `${name}: ${angleText(start)} to ${angleText(stop)}`, more: `${reasons}; ${more}` };
}

function select(options, told) {
  const made = element("select", {}, ...options.map(([value, textContent]) => element("option", { value, textContent })));
  made.onchange = () => told(made.value);
  return made;
}

function group(title, ...children) {
  return element("fieldset", {}, element("legend", { textContent: title }), ...children);
}

function change(owner, text) {
  if (owner.textContent !== text) owner.textContent = text;
}
