/**
 * Inverse kinematics of arms with six or seven turning joints: every configuration that reaches a pose, in WebAssembly.
 *
 *     import { load } from "jacokin";
 *     const solver = await load("j2n6s300");
 *     const branches = solver.all(solver.fk(solver.home));
 *
 * Metres and radians. A pose is the 4x4 matrix of the tool in the base: 16 numbers, row by row. What comes back is
 * within every joint limit exactly, and reaches its pose within 1e-6 m and 1e-6 rad by forward kinematics of the very
 * numbers, where it says so. `jacokin.d.ts` has the types and says what each of them means.
 */

import { robots } from "./robots.js";

/** Names of the arms that come with the package. */
export const names = Object.freeze(Object.keys(robots));

/** A wrong argument, or a solver file that is damaged. */
export class JacokinError extends Error {
  name = "JacokinError";
}

/** JACOKIN_IK_ABI_VERSION of the header: what the numbers below are of. */
const ABI_VERSION = 2;
const STATUSES = ["ok", "unreachable", "outside_limits", "no_convergence"];
const ENDS = ["limit", "fold", "range", "circle", "lost"];
const POSE = 16; // numbers
const MAX_DOF = 7;
const MAX_BRANCHES = 24;
const MAX_INTERVALS = 512;
/** Bytes and fields of the structures in jacokin_ik.h, for pointers of 4 bytes. */
const BRANCH = { size: 96, positionError: 56, orientationError: 64, distance: 72, margin: 80, success: 88, singular: 92 };
const AXIS = { size: 40 };
const INTERVAL = { size: 48, stop: 8, branch: 16, ends: 20, joints: 28 };
/** Work memory: of poses, and of curves. */
const POSES = 0;
const INTERVALS = 1;
/** Targets that are handed over at a time. */
const CHUNK = 512;

/**
 * Make a solver.
 *
 * @param {string | URL | ArrayBuffer | ArrayBufferView} robot a name of `names`; or where a file of `jacokin export-c` is, or its contents
 * @param {{ wasm?: string | URL | ArrayBuffer | ArrayBufferView | WebAssembly.Module }} [options]
 * @returns {Promise<Solver>}
 */
export async function load(robot = "j2n6s300", options = {}) {
  const [module, contents] = await Promise.all([compiled(options?.wasm), solverFile(robot)]);
  return new Solver(await functionsOf(module), contents, MAKING);
}

// --- Files ----------------------------------------------------------------------------------------------------------

/** Only `load` makes solvers: compiling cannot be waited for in a constructor. */
const MAKING = Symbol("load");
const FOREIGN = "wasm: this is not the WebAssembly module of jacokin";
/** Some bundlers leave the file behind, and some servers answer with a page where there is none. */
const BUNDLED = '; where a bundler leaves jacokin.wasm behind, copy it there, or give its place: load(name, { wasm: "/files/jacokin.wasm" })';
let ours; // a promise of the package's own module, compiled once

function compiled(wasm) {
  if (wasm === undefined) {
    ours ??= compile(new URL("./jacokin.wasm", import.meta.url), BUNDLED);
    ours.catch(() => (ours = undefined)); // another call may find the network again
    return ours;
  }
  if (wasm instanceof WebAssembly.Module) return wasm;
  if (typeof wasm === "string" || isBytes(wasm) || wasm instanceof URL) return compile(wasm);
  throw new JacokinError(`wasm must be where jacokin.wasm is, its contents, or a WebAssembly.Module, not ${shown(wasm)}`);
}

async function compile(source, advice = "") {
  const contents = isBytes(source) ? source : await read(source, advice);
  try {
    return await WebAssembly.compile(contents);
  } catch (error) {
    throw new JacokinError(`${FOREIGN}: ${error.message}${advice}`);
  }
}

/** What a module exports, if it is ours and of this version: a server or a cache may have kept another one. */
async function functionsOf(module) {
  let exports, version;
  try {
    ({ exports } = await WebAssembly.instantiate(module));
    version = exports.jacokin_ik_abi_version();
  } catch (error) {
    throw new JacokinError(`${FOREIGN}: ${error.message}`);
  }
  if (version !== ABI_VERSION) {
    throw new JacokinError(`wasm: its version is ${version} and that of jacokin.js ${ABI_VERSION}: take both from one package`);
  }
  exports._initialize();
  return exports;
}

async function solverFile(robot) {
  if (isBytes(robot)) return robot;
  if (robot instanceof URL) return read(robot);
  if (typeof robot !== "string" || !Object.hasOwn(robots, robot)) {
    const own = "for an arm of your own, give the contents or the URL of a file that `jacokin export-c` wrote";
    throw new JacokinError(`there is no arm ${shown(robot)}: known are ${names.join(", ")}; ${own}`);
  }
  return Uint8Array.from(atob(robots[robot]), (letter) => letter.charCodeAt(0));
}

function isBytes(value) {
  return value instanceof ArrayBuffer || ArrayBuffer.isView(value);
}

async function read(place, advice = "") {
  let url = place;
  try {
    url = place instanceof URL ? place : new URL(place, globalThis.location?.href ?? import.meta.url);
    if (url.protocol === "file:" && globalThis.process?.versions?.node) {
      const { readFile } = await import(/* webpackIgnore: true */ /* @vite-ignore */ "node:fs/promises");
      return await readFile(url);
    }
    const response = await fetch(url);
    if (response.ok) return await response.arrayBuffer();
    throw new Error(`the server answers ${response.status}`);
  } catch (error) {
    throw new JacokinError(`${url} cannot be read: ${error.message}${advice}`);
  }
}

// --- The solver -----------------------------------------------------------------------------------------------------

/** One arm with its frame, tool and limits. It has memory of its own, which goes when the solver is no longer used. */
export class Solver {
  #c; // functions of the C library
  #numbers; // views of its memory, made anew when it grows
  #integers;
  #handle;
  #at; // addresses of what is handed over
  #work = { task: undefined, address: undefined, size: 0 };
  #found; // the target whose intervals are in the work memory

  constructor(functions, contents, making) {
    if (making !== MAKING) throw new JacokinError("a Solver is made by `await load(robot)`");
    this.#c = functions;
    this.#handle = this.#read(contents);
    this.dof = this.#c.jacokin_ik_dof(this.#handle);
    this.robot = this.#text(this.#c.jacokin_ik_robot(this.#handle));
    this.base = this.#text(this.#c.jacokin_ik_base(this.#handle));
    this.frame = this.#text(this.#c.jacokin_ik_frame(this.#handle));
    const joints = Array.from({ length: this.dof }, (_, joint) => joint);
    this.jointNames = joints.map((joint) => this.#text(this.#c.jacokin_ik_joint_name(this.#handle, joint)));
    this.parameter = this.dof === 7 ? this.#c.jacokin_ik_parameter(this.#handle) : null;
    const doubles = (count) => this.#allocate(8 * count);
    this.#at = {
      target: doubles(CHUNK * POSE),
      seed: doubles(CHUNK * MAX_DOF),
      q: doubles(CHUNK * MAX_DOF),
      limits: doubles(3 * MAX_DOF),
      status: this.#allocate(4 * CHUNK),
      axis: this.#allocate(AXIS.size),
      parameter: doubles(1),
      count: this.#allocate(4),
      complete: this.#allocate(4),
      branches: this.#allocate(BRANCH.size * MAX_BRANCHES),
      intervals: this.#allocate(INTERVAL.size * MAX_INTERVALS),
    };
    const [lower, upper, home] = [0, 1, 2].map((row) => this.#at.limits + 8 * MAX_DOF * row);
    this.#c.jacokin_ik_limits(this.#handle, lower, upper, home);
    this.lower = this.#doubles(lower, this.dof);
    this.upper = this.#doubles(upper, this.dof);
    this.home = this.#doubles(home, this.dof);
    Object.freeze(this);
  }

  fk(q) {
    this.#put(this.#at.q, numbers("q", q, this.dof));
    this.#check(this.#c.jacokin_fk(this.#handle, this.#at.q, this.#at.target));
    return this.#doubles(this.#at.target, POSE);
  }

  all(pose, seed = null) {
    if (this.dof !== 6) throw new JacokinError("poses of seven joints have curves of configurations: use intervals()");
    const { target, branches, count, complete } = this.#at;
    this.#put(target, numbers("pose", pose, POSE));
    const near = this.#seed(seed);
    const work = this.#workFor(POSES);
    const status = this.#check(
      this.#c.jacokin_ik_all(this.#handle, target, near, ...work, branches, MAX_BRANCHES, count, complete),
    );
    const found = Array.from({ length: this.#integer(count) }, (_, i) => this.#branch(branches + BRANCH.size * i));
    return Object.assign(found, { ...this.#said(status), complete: this.#integer(complete) === 1 });
  }

  nearest(pose, seed = null, about = null) {
    const { target, q, parameter } = this.#at;
    this.#put(target, numbers("pose", pose, POSE));
    const near = this.#seed(seed);
    const axis = about === null ? 0 : this.#about(about);
    const work = this.#workFor(this.dof === 7 || axis ? INTERVALS : POSES);
    const status =
      this.dof === 7 || axis
        ? this.#c.jacokin_ik_nearest_about(this.#handle, target, axis, near, ...work, q, parameter)
        : this.#c.jacokin_ik_nearest(this.#handle, target, near, ...work, q);
    const reached = this.#check(status) === 0;
    const curve = reached && (this.dof === 7 || axis);
    return {
      ...this.#said(status),
      q: reached ? this.#doubles(q, this.dof) : null,
      parameter: curve ? this.#doubles(parameter, 1)[0] : null,
    };
  }

  batch(poses, seeds = null) {
    const targets = rows("poses", poses, POSE);
    const n = targets.length / POSE;
    const near = seeds === null || seeds === undefined ? null : rows("seeds", seeds, this.dof);
    if (near && near.length !== n * this.dof) {
      throw new JacokinError(`seeds: ${near.length / this.dof} for ${n} poses; give one for each, or none`);
    }
    const q = new Float64Array(n * this.dof);
    const status = new Array(n);
    const at = this.#at;
    const work = this.#workFor(this.dof === 7 ? INTERVALS : POSES);
    for (let first = 0; first < n; first += CHUNK) {
      const count = Math.min(CHUNK, n - first);
      this.#put(at.target, targets.subarray(first * POSE, (first + count) * POSE));
      if (near) this.#put(at.seed, near.subarray(first * this.dof, (first + count) * this.dof));
      const seed = near ? at.seed : 0;
      this.#check(this.#c.jacokin_ik_batch(this.#handle, count, at.target, seed, ...work, at.q, at.status));
      q.set(this.#doubles(at.q, count * this.dof), first * this.dof);
      for (let i = 0; i < count; i++) {
        const code = this.#integer(at.status + 4 * i);
        if (code < 0) throw new JacokinError(`pose ${first + i}: ${this.#text(this.#c.jacokin_ik_status_text(code))}`);
        status[first + i] = STATUSES[code];
      }
    }
    return { q, status };
  }

  intervals(pose, about = null) {
    // A copy, as intervals are found again for their points.
    const target = { pose: Float64Array.from(numbers("pose", pose, POSE)), about: about === null ? null : checkedAxis(about) };
    const status = this.#findIntervals(target);
    const { intervals, count, complete } = this.#at;
    const found = Array.from({ length: this.#integer(count) }, (_, i) =>
      this.#interval(target, intervals + INTERVAL.size * i),
    );
    return Object.assign(found, { ...this.#said(status), complete: this.#integer(complete) === 1 });
  }

  // --- What comes back ----------------------------------------------------------------------------------------------

  #branch(address) {
    const number = (offset) => this.#doubles(address + offset, 1)[0];
    return {
      q: this.#doubles(address, this.dof),
      withinLimits: this.#integer(address + BRANCH.success) === 1,
      distance: number(BRANCH.distance),
      margin: number(BRANCH.margin),
      singular: this.#integer(address + BRANCH.singular) === 1,
      positionError: number(BRANCH.positionError),
      orientationError: number(BRANCH.orientationError),
    };
  }

  #findIntervals(target) {
    const { intervals, count, complete } = this.#at;
    this.#put(this.#at.target, target.pose);
    const axis = target.about === null ? 0 : this.#about(target.about);
    if (this.dof === 6 && !axis) {
      throw new JacokinError("six joints at a pose have single configurations: use all(), or give an axis: { axis: [0, 0, 1] }");
    }
    const work = this.#workFor(INTERVALS);
    const status = this.#check(
      this.#c.jacokin_ik_intervals(
        this.#handle, this.#at.target, axis, ...work, intervals, MAX_INTERVALS, count, complete,
      ),
    );
    this.#found = target;
    return status;
  }

  #interval(target, address) {
    const start = this.#doubles(address, 1)[0];
    const stop = this.#doubles(address + INTERVAL.stop, 1)[0];
    const sides = [0, 4];
    const fields = new Uint8Array(this.#c.memory.buffer).slice(address, address + INTERVAL.size);
    return {
      start,
      stop,
      branch: this.#integer(address + INTERVAL.branch),
      ends: sides.map((side) => ENDS[this.#integer(address + INTERVAL.ends + side)]),
      joints: sides.map((side) => this.#integer(address + INTERVAL.joints + side)).map((joint) => (joint < 0 ? null : joint)),
      at: (parameter, seed = null) => this.#pointAt(target, { start, stop, fields }, parameter, seed),
    };
  }

  /** The configuration of an interval; its curves are found again where another call has used the memory meanwhile. */
  #pointAt(target, { start, stop, fields }, parameter, seed) {
    if (!Number.isFinite(parameter)) throw new JacokinError(`the parameter must be a finite number, not ${shown(parameter)}`);
    const near = this.#seed(seed);
    if (this.#found !== target) this.#findIntervals(target);
    const { intervals, q } = this.#at;
    new Uint8Array(this.#c.memory.buffer).set(fields, intervals);
    const { address, size } = this.#work;
    const status = this.#c.jacokin_ik_at(this.#handle, address, size, intervals, parameter, near, q);
    if (status === -1) throw new JacokinError(`the parameter ${parameter} is not from ${start} to ${stop} rad`);
    return this.#check(status) === 0 ? this.#doubles(q, this.dof) : null;
  }

  #said(status) {
    return { status: STATUSES[status], message: this.#text(this.#c.jacokin_ik_status_text(status)) };
  }

  /** A status about the target; one about the call is an error. */
  #check(status) {
    if (status < 0) throw new JacokinError(this.#text(this.#c.jacokin_ik_status_text(status)));
    return status;
  }

  // --- What is handed over ------------------------------------------------------------------------------------------

  #seed(seed) {
    if (seed === null || seed === undefined) return 0;
    this.#put(this.#at.seed, numbers("seed", seed, this.dof));
    return this.#at.seed;
  }

  #about(about) {
    if (this.dof === 7) throw new JacokinError("the axis is for six joints: seven have a free parameter as they are");
    const { axis, range } = checkedAxis(about);
    this.#put(this.#at.axis, axis);
    this.#put(this.#at.axis + 24, range);
    return this.#at.axis;
  }

  // --- Memory -------------------------------------------------------------------------------------------------------

  #allocate(bytes) {
    const address = this.#c.malloc(bytes);
    if (address === 0) throw new JacokinError("there is no memory for the solver");
    return address;
  }

  /** Address and size of memory for a task; that for curves, 5 MB, is taken when they are first asked for. */
  #workFor(task) {
    const work = this.#work;
    this.#found = undefined;
    if (work.task === undefined || work.task < task) {
      this.#c.free(work.address ?? 0);
      work.address = work.task = undefined;
      work.size = this.#c.jacokin_ik_work_size(this.#handle, task);
      work.address = this.#allocate(work.size);
      work.task = task;
    }
    return [work.address, work.size];
  }

  #read(contents) {
    const bytes = ArrayBuffer.isView(contents)
      ? new Uint8Array(contents.buffer, contents.byteOffset, contents.byteLength)
      : new Uint8Array(contents);
    const file = this.#allocate(bytes.length + 1);
    const made = this.#allocate(4);
    new Uint8Array(this.#c.memory.buffer).set(bytes, file);
    const status = this.#c.jacokin_ik_read(file, bytes.length, made);
    const handle = this.#integer(made);
    this.#c.free(file);
    this.#c.free(made);
    this.#check(status);
    return handle;
  }

  #put(address, values) {
    this.#refresh();
    this.#numbers.set(values, address / 8);
  }

  #doubles(address, count) {
    this.#refresh();
    return this.#numbers.slice(address / 8, address / 8 + count);
  }

  #integer(address) {
    this.#refresh();
    return this.#integers[address / 4];
  }

  #text(address) {
    const bytes = new Uint8Array(this.#c.memory.buffer, address);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  #refresh() {
    const { buffer } = this.#c.memory;
    if (this.#numbers?.buffer === buffer) return;
    this.#numbers = new Float64Array(buffer);
    this.#integers = new Int32Array(buffer);
  }
}

// --- What is checked at the border ----------------------------------------------------------------------------------

/** Values of an argument, so many finite numbers. */
function numbers(name, values, length) {
  const listed = Array.isArray(values) || isNumbers(values);
  if (!listed || values.length !== length) {
    throw new JacokinError(`${name} must be ${length} numbers, not ${listed ? `${values.length} of them` : shown(values)}`);
  }
  return finite(name, values);
}

/** A copy of an axis and its range; the length of an axis does not matter, and its largest number becomes 1. */
function checkedAxis(about) {
  if (about?.axis === undefined) {
    throw new JacokinError(`the axis must be like { axis: [0, 0, 1], range: [-1, 1] }, not ${shown(about)}`);
  }
  const axis = Float64Array.from(numbers("axis", about.axis, 3));
  const range = Float64Array.from(numbers("range", about.range ?? [-Math.PI, Math.PI], 2));
  const most = Math.max(...axis.map(Math.abs));
  if (most === 0) throw new JacokinError("axis must not be 0");
  const [low, high] = range;
  if (!(low < high) || high - low > 2 * Math.PI + 1e-12 || Math.max(Math.abs(low), Math.abs(high)) > 1e3) {
    throw new JacokinError(`range must rise by at most 2 pi, within 1000 rad of 0, not go from ${low} to ${high}`);
  }
  return { axis: axis.map((number) => number / most), range };
}

/** Values of an argument, rows of so many finite numbers: one after another, or an array of rows. */
function rows(name, values, length) {
  if (Array.isArray(values) && values.length > 0 && typeof values[0] !== "number") {
    const joined = new Float64Array(values.length * length);
    // Not forEach, which passes over holes.
    for (let i = 0; i < values.length; i++) joined.set(numbers(`${name}[${i}]`, values[i], length), length * i);
    return joined;
  }
  if (!(Array.isArray(values) || isNumbers(values)) || values.length % length !== 0) {
    throw new JacokinError(`${name} must be rows of ${length} numbers`);
  }
  return Float64Array.from(finite(name, values));
}

function isNumbers(values) {
  return ArrayBuffer.isView(values) && !(values instanceof DataView);
}

function finite(name, values) {
  for (let i = 0; i < values.length; i++) {
    if (!Number.isFinite(values[i])) throw new JacokinError(`${name} must be finite numbers: number ${i} is ${shown(values[i])}`);
  }
  return values;
}

/** A value in a message, whatever it is. */
function shown(value) {
  if (typeof value === "string") return JSON.stringify(value);
  try {
    return String(value);
  } catch {
    return Object.prototype.toString.call(value);
  }
}
