import { load } from "./jacokin.js";
import { unpack } from "./unpack.js";

/** Points of each curve: while the tool is dragged, and at rest. */
const POINTS = { coarse: 9, fine: 61 };
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

const wasm = unpack(WASM).then((bytes) => WebAssembly.compile(bytes));
const solvers = new Map(); // promises, by name

/** Questions are answered one after another: `{ id, robot, pose, seed, free, fine }`; `{ robot, file }` opens a file. */
let last = Promise.resolve();
onmessage = ({ data }) => {
  last = last.then(async () => {
    try {
      const done = data.file ? { opened: await open(data) } : answer(await solverOf(data.robot), data);
      postMessage({ id: data.id, ...done });
    } catch (error) {
      postMessage({ id: data.id, error: error.message });
    }
  });
};

/** From now on a solver file answers to a name. What it says of its arm, and poses of the tool: `own.js` says where. */
async function open({ robot, file }) {
  const solver = await load(file, { wasm: await wasm });
  solvers.set(robot, Promise.resolve(solver));
  const { dof, jointNames: joints, base, frame, lower, upper, home } = solver;
  const turned = Array.from({ length: dof + 1 }, (_, one) => joints.map((_, i) => (i === one - 1 ? Math.PI / 2 : 0)));
  return { joints: [...joints], base, frame, lower, upper, home, poses: turned.map((q) => solver.fk(q)) };
}

async function solverOf(name) {
  if (!solvers.has(name)) solvers.set(name, load(name, { wasm: await wasm }));
  return solvers.get(name);
}

function answer(solver, question) {
  const start = performance.now();
  const found = solver.dof === 7 || question.free ? curves(solver, question) : branches(solver, question);
  return { ...found, milliseconds: performance.now() - start };
}

/** Single configurations: all branches, and the nearest within the limits. */
function branches(solver, { pose, seed }) {
  const found = solver.all(pose, seed);
  const { status, message, complete } = found;
  const q = found.find((branch) => branch.withinLimits)?.q ?? null;
  return { status, message, complete, q, parameter: null, branches: [...found], curves: [] };
}

/** A free axis, or seven joints: intervals with points on them, and the nearest configuration. */
function curves(solver, { pose, seed, free, fine }) {
  const about = solver.dof === 7 ? null : { axis: AXES[free] };
  const { status, message, q, parameter } = solver.nearest(pose, seed, about);
  const found = solver.intervals(pose, about);
  const points = fine ? POINTS.fine : POINTS.coarse;
  const sampled = found.map(({ start, stop, branch, ends, joints, at }) => {
    const parameters = Array.from({ length: points }, (_, i) => start + ((stop - start) * i) / (points - 1));
    return { start, stop, branch, ends, joints, parameters, q: parameters.map((each) => at(each, seed)) };
  });
  const { complete } = found;
  return { status, message, complete, q, parameter, joint: solver.parameter, branches: [], curves: sampled };
}
