/** What is refused, and what a page may do with the module: no Python has to be there. */

import assert from "node:assert/strict";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { pathToFileURL } from "node:url";

import { JacokinError, Solver, load, names } from "../jacokin.js";

const refused = (call, words) =>
  assert.throws(call, (error) => error instanceof JacokinError && words.test(error.message));
const rejected = (promise, words) =>
  assert.rejects(promise, (error) => error instanceof JacokinError && words.test(error.message));

/** A module without functions, and one whose `jacokin_ik_abi_version` says 1. */
const EMPTY = Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0);
const NAME = new TextEncoder().encode("jacokin_ik_abi_version");
const OTHER_VERSION = Uint8Array.of(
  ...EMPTY,
  ...[1, 5, 1, 96, 0, 1, 127], // types: a function gives an i32
  ...[3, 2, 1, 0], // functions: one of them
  ...[7, NAME.length + 4, 1, NAME.length, ...NAME, 0, 0], // exports
  ...[10, 6, 1, 4, 0, 65, 1, 11], // code: i32.const 1
);

test("every bundled arm solves the pose of its home", async () => {
  assert.ok(names.length >= 11);
  for (const name of names) {
    const solver = await load(name);
    assert.equal(solver.robot, name);
    assert.equal(solver.jointNames.length, solver.dof);
    const { q, status } = solver.nearest(solver.fk(solver.home));
    assert.equal(status, "ok", name);
    assert.ok(q.every((angle, j) => Math.abs(angle - solver.home[j]) < 1e-6), name);
  }
});

test("wrong arguments are errors that name them", async () => {
  const six = await load("j2n6s300");
  const seven = await load("j2s7s300");
  const pose = six.fk(six.home);
  await rejected(load("j2n7"), /no arm "j2n7": known are j2n6s300, .*export-c/);
  await rejected(load(7), /no arm 7/);
  await rejected(load(7n), /no arm 7/);
  const circle = {};
  await rejected(load(Object.assign(circle, { circle })), /no arm \[object Object\]/);
  await rejected(load(new Uint8Array(40)), /damaged/);
  await rejected(load(new URL("none.jacokin", import.meta.url)), /none.jacokin cannot be read/);
  await rejected(load("gen3", { wasm: new Uint8Array(40) }), /wasm: this is not/);
  await rejected(load("gen3", { wasm: EMPTY }), /wasm: this is not .*jacokin_ik_abi_version/);
  await rejected(load("gen3", { wasm: OTHER_VERSION }), /its version is 1 and that of jacokin.js \d+/);
  await rejected(load("gen3", { wasm: "http://[" }), /cannot be read: Invalid URL/);
  for (const wasm of [null, 7, {}, Symbol("wasm"), Promise.resolve(EMPTY), new Response(EMPTY)]) {
    await rejected(load("gen3", { wasm }), /^wasm must be where jacokin.wasm is, its contents, or a WebAssembly.Module, not/);
  }
  refused(() => new Solver(), /made by `await load/);
  refused(() => six.fk([1, 2, 3]), /q must be 6 numbers, not 3/);
  refused(() => six.fk(undefined), /q must be 6 numbers, not undefined/);
  refused(() => six.fk("123456"), /q must be 6 numbers/);
  refused(() => six.fk([0, 0, 0, 0, 0, NaN]), /number 5 is NaN/);
  refused(() => six.fk([0, 0, 0, 0, 0, "1"]), /number 5 is "1"/);
  refused(() => six.fk([0, 0, 0, 0, 0, Symbol("1")]), /number 5 is Symbol\(1\)/);
  refused(() => six.fk(Object.create(null)), /q must be 6 numbers, not \[object Object\]/);
  refused(() => six.fk({ length: 6 }), /q must be 6 numbers, not \[object Object\]/);
  refused(() => six.all(pose.slice(1)), /pose must be 16 numbers/);
  refused(() => six.all(pose.map((x) => 2 * x)), /not a rotation/);
  refused(() => six.all(pose, [1]), /seed must be 6 numbers/);
  refused(() => seven.all(seven.fk(seven.home)), /use intervals/);
  refused(() => six.intervals(pose), /use all\(\), or give an axis/);
  refused(() => seven.intervals(seven.fk(seven.home), { axis: [0, 0, 1] }), /for six joints/);
  for (const about of [six.home, [0, 0, 1], {}, 0]) { // a seed in its place, for one
    refused(() => six.nearest(pose, null, about), /the axis must be like \{ axis: \[0, 0, 1\], range/);
    refused(() => six.intervals(pose, about), /the axis must be like/);
  }
  refused(() => six.intervals(pose, { axis: [0, 0, 0] }), /axis must not be 0/);
  refused(() => six.intervals(pose, { axis: [0, 0] }), /axis must be 3 numbers/);
  refused(() => six.intervals(pose, { axis: [0, 0, 1], range: [1, 0] }), /range must rise/);
  refused(() => six.batch([...pose, 1]), /rows of 16/);
  refused(() => six.batch([pose, pose], [six.home]), /1 for 2 poses/);
  refused(() => six.batch([pose, pose, pose], [six.home, , six.home]), /seeds\[1\] must be 6 numbers, not undefined/);
  refused(() => six.intervals(pose, { axis: [0, 0, 1] })[0].at(Symbol("p")), /must be a finite number, not Symbol\(p\)/);
  refused(() => six.batch([pose, pose.map((x) => 2 * x)]), /pose 1: /);
  assert.equal(six.nearest(pose).status, "ok", "it works on after errors");
});

test("what cannot be reached is a status, with advice", async () => {
  const solver = await load();
  const far = [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const answer = solver.nearest(far);
  assert.deepEqual([answer.status, answer.q], ["unreachable", null]);
  assert.match(answer.message, /closer to the arm/);
  assert.deepEqual([...solver.all(far)], []);
  assert.equal(solver.all(far).status, "unreachable");
  assert.deepEqual(solver.batch([far]).status, ["unreachable"]);
  assert.deepEqual(solver.batch([]).status, []);
});

test("answers are copies: later calls leave them alone", async () => {
  const solver = await load();
  const first = solver.nearest(solver.fk(solver.home)).q;
  const kept = first.slice();
  solver.nearest(solver.fk(solver.home.map((angle) => angle + 0.1)));
  assert.deepEqual(first, kept);
});

test("numbers of single precision are taken", async () => {
  const solver = await load();
  const pose = Float32Array.from(solver.fk(solver.home));
  assert.equal(solver.nearest(pose, Float32Array.from(solver.home)).status, "ok");
});

test("the points of an interval outlive other calls", async () => {
  const solver = await load("j2n6s300");
  const about = { axis: [1, 0, 0], range: [-0.5, 0.5] };
  const [interval] = solver.intervals(solver.fk(solver.home), about);
  const middle = 0.5 * (interval.start + interval.stop);
  const before = interval.at(middle);
  about.range[0] = 0.4; // it was copied
  solver.intervals(solver.fk(solver.home.map((angle) => angle + 0.2)), about);
  assert.deepEqual(interval.at(middle), before);
  const proxied = new Proxy({ axis: [1, 0, 0], range: [-0.5, 0.5], label: () => "a page's own" }, {});
  assert.deepEqual(solver.intervals(solver.fk(solver.home), proxied)[0].at(middle), before);
  refused(() => interval.at(1.5), /is not from/);
  refused(() => interval.at(NaN), /finite/);
});

test("an axis has any length", async () => {
  const solver = await load();
  const pose = solver.fk(solver.home);
  const found = [1, 1e-200, 1e200].map((length) => solver.intervals(pose, { axis: [0, length, length] }));
  for (const each of found) assert.deepEqual(each.map(({ start }) => start), found[0].map(({ start }) => start));
});

test("a page may bring the WebAssembly itself", async () => {
  const bytes = await readFile(new URL("../jacokin.wasm", import.meta.url));
  const module = await WebAssembly.compile(bytes);
  assert.deepEqual(WebAssembly.Module.imports(module), []);
  for (const wasm of [bytes, module, new URL("../jacokin.wasm", import.meta.url)]) {
    const solver = await load("gen3_lite", { wasm });
    assert.equal(solver.nearest(solver.fk(solver.home)).status, "ok");
  }
});

test("a file that a bundler has left behind is told where it belongs", async () => {
  const folder = await mkdtemp(join(tmpdir(), "jacokin-"));
  try {
    for (const name of ["jacokin.js", "robots.js"]) {
      await writeFile(join(folder, name.replace(".js", ".mjs")), (await readFile(new URL(`../${name}`, import.meta.url), "utf8")).replace("robots.js", "robots.mjs"));
    }
    const bundle = await import(pathToFileURL(join(folder, "jacokin.mjs")));
    await assert.rejects(bundle.load(), /jacokin.wasm cannot be read: .*where a bundler leaves jacokin.wasm behind, copy it there, or give its place/);
    await writeFile(join(folder, "jacokin.wasm"), "<!doctype html>"); // as some servers answer
    await assert.rejects(bundle.load(), /wasm: this is not .*where a bundler leaves jacokin.wasm behind/);
    await writeFile(join(folder, "jacokin.wasm"), await readFile(new URL("../jacokin.wasm", import.meta.url)));
    assert.equal((await bundle.load("gen3")).robot, "gen3");
  } finally {
    await rm(folder, { recursive: true });
  }
});

test("the types are complete without those of pages, as programs for Node are checked", async () => {
  const types = await readFile(new URL("../jacokin.d.ts", import.meta.url), "utf8");
  const code = types.replaceAll(/\/\*\*.*?\*\//gs, "");
  assert.doesNotMatch(code, /BufferSource|WebAssembly\.|: URL|\| URL/);
});

test("the example in the README runs", async () => {
  const readme = await readFile(new URL("../README.md", import.meta.url), "utf8");
  const blocks = [...readme.matchAll(/```js\n(.*?)```/gs)].map((found) => found[1]);
  const folder = await mkdtemp(join(tmpdir(), "jacokin-"));
  try {
    assert.ok(blocks.length > 1);
    const file = join(folder, "example.mjs");
    await writeFile(file, blocks.join("\n").replace('"jacokin"', JSON.stringify(new URL("../jacokin.js", import.meta.url))));
    await import(pathToFileURL(file));
  } finally {
    await rm(folder, { recursive: true });
  }
});
