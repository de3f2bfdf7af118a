/**
 * Inverse kinematics of arms with six or seven turning joints: every configuration that reaches a pose, in WebAssembly.
 *
 * Metres and radians throughout. Arguments that are wrong throw a `JacokinError`; a pose that cannot be reached is a
 * `Status`.
 */

/** Numbers as arguments: every one finite. */
export type Numbers = readonly number[] | Float64Array | Float32Array;

/** 16 numbers: the 4x4 matrix of the tool in the base, row by row, with 0 0 0 1 as its last row. Orthonormal to 1e-6. */
export type Pose = Numbers;

/** One angle for each joint, base to tip [rad]. */
export type Configuration = Numbers;

/**
 * - `ok`: the pose is reached within the tolerances, and every joint is within its limits
 * - `unreachable`: no joint angles reach it, with or without limits
 * - `outside_limits`: it can only be reached by breaking a joint limit
 * - `no_convergence`: nothing was found, and it is not certain that there is nothing
 */
export type Status = "ok" | "unreachable" | "outside_limits" | "no_convergence";

/** What became of a target. */
export interface Outcome {
  readonly status: Status;
  /** What the status means and what to try: one sentence. */
  readonly message: string;
}

/** One configuration that reaches a pose. */
export interface Branch {
  /** [rad]; unlimited joints nearest to the seed, others within their limits if possible. */
  readonly q: Float64Array;
  /** Whether every joint is within its limits, exactly, and q reaches the pose within 1e-6 m and 1e-6 rad. */
  readonly withinLimits: boolean;
  /** From the seed [rad], Euclidean. */
  readonly distance: number;
  /** To the nearest limit [rad]: negative outside, infinite without limits. */
  readonly margin: number;
  /** Whether it stands for a whole curve: two axes of a spherical wrist are on one line. */
  readonly singular: boolean;
  /** By forward kinematics of q [m]. */
  readonly positionError: number;
  /** By forward kinematics of q [rad]. */
  readonly orientationError: number;
}

/** Every branch of a pose, nearest to the seed first, within the limits or not. */
export interface Branches extends Array<Branch>, Outcome {
  /** Whether none is missing. */
  readonly complete: boolean;
}

/** The nearest configuration. */
export interface Answer extends Outcome {
  /** [rad]; null on anything but `ok`. */
  readonly q: Float64Array | null;
  /** Where it is on its curve [rad]: the angle about the axis, or joint `solver.parameter`. Null where there is no curve. */
  readonly parameter: number | null;
}

/** The nearest configurations of many poses. */
export interface Batch {
  /** A row of `dof` angles for each pose [rad], one after another; NaN where it has no answer. */
  readonly q: Float64Array;
  readonly status: Status[];
}

/** An axis of the tool about which it may turn, by the right hand. */
export interface FreeAxis {
  /** Direction in the tool's frame, through its origin; of any length but 0. */
  readonly axis: Numbers;
  /** Least and largest angle [rad]; a full turn by default. */
  readonly range?: Numbers;
}

/**
 * Why an interval ends: a joint is on its `limit`; two branches meet in a `fold`; the `range` of the axis ends; nothing
 * ends on a `circle`; the curve was `lost`, and could not be followed further.
 */
export type End = "limit" | "fold" | "range" | "circle" | "lost";

/** Configurations on one branch while the parameter goes from start to stop: each reaches the pose within the limits. */
export interface Interval {
  /** [rad]; the parameter is the angle about the axis, or that of joint `solver.parameter`. */
  readonly start: number;
  /** [rad]; at most start + 2 pi. */
  readonly stop: number;
  /** Two intervals on one branch are parts of one curve. */
  readonly branch: number;
  /** Why it ends at start and at stop. */
  readonly ends: [End, End];
  /** Index of the joint that is on its limit there. */
  readonly joints: [number | null, number | null];
  /**
   * The configuration at a value of the parameter [rad]; null where the point found does not reach the pose within the
   * limits. Joints take the 2 pi equivalent that is nearest to the seed, or to home.
   */
  at(parameter: number, seed?: Configuration | null): Float64Array | null;
}

/** All configurations with one free parameter, by branch and start. */
export interface Intervals extends Array<Interval>, Outcome {
  /** Whether nothing is missing. */
  readonly complete: boolean;
}

/** One arm with its frame, tool and limits; made by `load`. */
export class Solver {
  private constructor();
  /** Number of joints, 6 or 7. */
  readonly dof: number;
  readonly robot: string;
  readonly base: string;
  /** The frame that is brought to a pose. */
  readonly frame: string;
  readonly jointNames: readonly string[];
  /** [rad]; infinite where a joint has no limit. */
  readonly lower: Float64Array;
  readonly upper: Float64Array;
  /** A configuration within the limits without contact [rad]. */
  readonly home: Float64Array;
  /** Index of the joint that is the parameter of a seven-joint arm; null for six joints. */
  readonly parameter: number | null;

  /** The pose of the tool in the base: 16 numbers, row by row. */
  fk(q: Configuration): Float64Array;

  /** Every branch of a pose of six joints, nearest to the seed, or to home, first. */
  all(pose: Pose, seed?: Configuration | null): Branches;

  /** The configuration nearest to the seed, or to home, that reaches a pose, or a pose turned about an axis. */
  nearest(pose: Pose, seed?: Configuration | null, about?: FreeAxis | null): Answer;

  /** The same for many poses: one after another, or an array of them; a seed for each, or none. */
  batch(poses: Numbers | readonly Pose[], seeds?: Numbers | readonly Configuration[] | null): Batch;

  /** All configurations of seven joints at a pose, or of six joints whose tool may turn about an axis. */
  intervals(pose: Pose, about?: FreeAxis | null): Intervals;
}

/** A wrong argument, or a solver file that is damaged. */
export class JacokinError extends Error {}

/** The contents of a file. */
export type Bytes = ArrayBuffer | ArrayBufferView;

/** The classes of the platform, as far as its types are loaded: programs for Node need not have those of pages. */
type Address = typeof globalThis extends { URL: { prototype: infer Class } } ? Class : never;
type Module = typeof globalThis extends { WebAssembly: { Module: { prototype: infer Class } } } ? Class : never;

/** Names of the arms that come with the package. */
export const names: readonly string[];

/**
 * Make a solver.
 *
 * @param robot One of `names`; or the URL or the contents of a file that `jacokin export-c` wrote.
 * @param options `wasm`: where `jacokin.wasm` is, its contents, or the compiled module. By default it lies beside this file.
 */
export function load(
  robot?: string | Address | Bytes,
  options?: { wasm?: string | Address | Bytes | Module },
): Promise<Solver>;
