/** WebAssembly answers as the native library does, whose answers `python -m tests.web.reference FOLDER` writes. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { load } from "../jacokin.js";

const FOLDER = new URL(process.env.JACOKIN_REFERENCE ?? "./reference/", import.meta.url);
const text = (name) => JSON.parse(readFileSync(new URL(name, FOLDER), "utf8"));
/** [rad] Both have other functions of trigonometry, and a branch that is nearly double amplifies their roundings. */
const TYPICAL = 1e-12;
const WORST = 1e-10;

/** The largest difference of two configurations [rad]. */
const apart = (a, b) => a.reduce((most, angle, j) => Math.max(most, Math.abs(angle - b[j])), 0);
const share = (values, bound) => values.filter((value) => value <= bound).length / values.length;

function reference(name) {
  const about = text(`${name}.json`);
  const bytes = readFileSync(new URL(`${name}.f64`, FOLDER));
  const doubles = new Float64Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
  const { n } = about;
  const [poses, seeds, nearest] = [16, 6, 6].reduce(
    ([found, at], size) => [[...found, doubles.subarray(at, at + n * size)], at + n * size],
    [[], 0],
  )[0];
  return { ...about, poses, seeds, nearest, branches: doubles.subarray(n * 28) };
}

for (const name of ["j2n6s300", "j2s6s300", "gen3_lite"]) {
  test(`${name}: all branches of each pose`, async (t) => {
    const solver = await load(name);
    const expected = reference(name);
    const differences = [];
    let row = 0;
    for (let i = 0; i < expected.n; i++) {
      const found = solver.all(expected.poses.subarray(16 * i, 16 * i + 16), expected.seeds.subarray(6 * i, 6 * i + 6));
      assert.equal(found.length, expected.counts[i], `pose ${i}`);
      const theirs = found.map((_, k) => expected.branches.subarray(6 * (row + k), 6 * (row + k) + 6));
      const within = found.map((_, k) => expected.within[row + k]);
      for (const branch of found) {
        // Of two that are as far from the seed as each other, rounding decides which comes first.
        const order = theirs.map((q) => apart(branch.q, q));
        const same = order.indexOf(Math.min(...order));
        differences.push(order[same]);
        assert.equal(branch.withinLimits, within[same], `pose ${i}`);
        if (branch.withinLimits) {
          const reached = solver.fk(branch.q);
          assert.ok(apart(reached, expected.poses.subarray(16 * i, 16 * i + 16)) < 2e-6, `pose ${i}`);
          assert.ok(branch.q.every((angle, j) => solver.lower[j] <= angle && angle <= solver.upper[j]), `pose ${i}`);
        }
      }
      row += found.length;
    }
    const worst = Math.max(...differences);
    const typical = share(differences, TYPICAL);
    t.diagnostic(`${row} branches: ${(100 * typical).toFixed(2)} % within ${TYPICAL} rad, the worst ${worst.toExponential(1)}`);
    assert.ok(row > 3 * expected.n);
    assert.ok(typical > 0.999);
    assert.ok(worst < WORST);
  });

  test(`${name}: the nearest branch of each pose`, async () => {
    const solver = await load(name);
    const { poses, seeds, nearest, status, n } = reference(name);
    const found = solver.batch(poses, seeds);
    assert.deepEqual(found.status, status);
    for (let i = 0; i < n; i++) {
      const [ours, theirs] = [found.q, nearest].map((q) => q.subarray(6 * i, 6 * i + 6));
      if (status[i] === "ok") assert.ok(apart(ours, theirs) < WORST, `pose ${i}`);
      else assert.ok(ours.every(Number.isNaN));
    }
    for (const i of [0, 1, 2, 600]) {
      const one = solver.nearest(poses.subarray(16 * i, 16 * i + 16), seeds.subarray(6 * i, 6 * i + 6));
      assert.equal(one.status, status[i]);
      assert.deepEqual(one.q, one.status === "ok" ? found.q.slice(6 * i, 6 * i + 6) : null);
    }
  });
}

for (const name of ["j2n6s300", "gen3_lite", "j2s7s300", "gen3"]) {
  test(`${name}: intervals of a free parameter`, async (t) => {
    const solver = await load(name);
    const differences = [];
    for (const row of text("curves.json")[name]) {
      const found = solver.intervals(row.pose, row.about);
      assert.equal(found.length, row.intervals.length);
      assert.equal(found.status, row.status);
      assert.equal(found.complete, row.complete);
      solver.nearest(row.pose, row.seed, row.about); // the points that are asked for next have to be found again
      found.forEach((interval, k) => {
        const { start, stop, ends, middle } = row.intervals[k];
        differences.push(apart([interval.start, interval.stop], [start, stop]));
        assert.deepEqual(interval.ends, ends);
        differences.push(apart(interval.at(0.5 * (start + stop), row.seed), middle));
      });
      const nearest = solver.nearest(row.pose, row.seed, row.about);
      assert.equal(nearest.status === "ok", row.nearest !== null);
      if (row.nearest) differences.push(apart([...nearest.q, nearest.parameter], [...row.nearest.q, row.nearest.parameter]));
    }
    const worst = Math.max(...differences);
    t.diagnostic(`${differences.length} numbers: the worst difference is ${worst.toExponential(1)} rad`);
    assert.ok(differences.length > 60);
    assert.ok(worst < 1e-9);
  });
}

test("there is room for all intervals of a straight arm", async () => {
  const solver = await load(readFileSync(new URL("straight.jacokin", FOLDER)));
  const { pose, count } = text("straight.json");
  const found = solver.intervals(pose);
  assert.ok(count > 256);
  assert.equal(found.length, count);
  assert.equal(found.complete, false);
});

test("a solver file of one's own", async () => {
  const url = new URL("own.jacokin", FOLDER);
  const own = await load(readFileSync(url));
  assert.deepEqual([own.lower[1], own.upper[1]], [1, 5]);
  assert.deepEqual((await load(url)).fk(own.home), own.fk(own.home));
  const plain = await load("j2n6s300");
  const [a, b] = [own, plain].map((solver) => solver.fk(plain.home));
  assert.ok(Math.abs(Math.hypot(a[3] - b[3], a[7] - b[7], a[11] - b[11]) - 0.1) < 1e-12);
});
