import { IDENTITY, column, cross, dot, length, minus, movedTo, plus, position, scaled, turned } from "./matrices.js";

/** What the tool is dragged by: arrows, a dot to move it in the plane of the screen, rings to turn it. */

const SIZE = { arrow: 92, ring: 62, narrow: 0.8, room: 260 }; // [pixel], and the factor on a narrow page
const REACH = { mouse: 10, touch: 22 }; // [pixel]
const SIDES = 64; // of a ring
const EDGE_ON = 0.25; // least cosine between the axis of a ring and the line of sight for which its plane is hit
export const AXES = ["x", "y", "z"];

export class Handles {
  /** Axes of the arrows and rings: those of the base, or of the tool. */
  frame = "base";
  /** What is under the pointer or dragged: `{ kind: "arrow" | "plane" | "ring", axis }`, or null. */
  active = null;

  /**
   * @param {HTMLCanvasElement} stage on which the tool is seen
   * @param {HTMLCanvasElement} canvas a small one, which follows the tool: less is drawn than on the whole stage
   */
  constructor(stage, canvas) {
    this.stage = stage;
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { willReadFrequently: true }); // drawn by the processor: it is small
    canvas.style.width = canvas.style.height = `${SIZE.room}px`;
  }

  get #view() {
    return [this.stage.clientWidth, this.stage.clientHeight];
  }

  directions(pose) {
    return [0, 1, 2].map((axis) => column(this.frame === "tool" ? pose : IDENTITY, axis));
  }

  /** The handle at a pixel, or null. */
  at(camera, pose, x, y, pointer) {
    const reach = pointer === "mouse" ? REACH.mouse : REACH.touch;
    const shapes = this.#shapes(camera, pose);
    const centre = shapes.centre;
    if (Math.hypot(x - centre.x, y - centre.y) < reach) return { kind: "plane" };
    let best = null;
    const offer = (distance, handle) => {
      if (distance < reach && (best === null || distance < best.distance)) best = { distance, handle };
    };
    shapes.arrows.forEach((end, axis) => offer(toSegment(x, y, part(centre, end, 0.2), end), { kind: "arrow", axis }));
    shapes.rings.forEach((ring, axis) => {
      for (let i = 0; i < SIDES; i++) {
        const next = ring[(i + 1) % SIDES];
        if (ring[i].front) offer(toSegment(x, y, ring[i], next) + 1, { kind: "ring", axis });
      }
    });
    return best?.handle ?? null;
  }

  /** Begin to drag: a function from a pixel to the pose of the tool. */
  drag(handle, camera, pose, x, y) {
    const [width, height] = this.#view;
    const origin = position(pose);
    const ray = (u, v) => ({ eye: camera.eye, along: camera.ray(u, v, width, height) });
    if (handle.kind === "plane") {
      const from = onPlane(ray(x, y), origin, camera.axes[2]);
      return (u, v) => movedTo(pose, plus(origin, minus(onPlane(ray(u, v), origin, camera.axes[2]) ?? from, from)));
    }
    const axis = this.directions(pose)[handle.axis];
    if (handle.kind === "arrow") {
      const from = alongLine(ray(x, y), origin, axis);
      return (u, v) => movedTo(pose, plus(origin, scaled(axis, (alongLine(ray(u, v), origin, axis) ?? from) - from)));
    }
    const facing = dot(axis, camera.axes[2]);
    if (Math.abs(facing) < EDGE_ON) {
      // The ring is a line on the screen: along it, a radius is a radian.
      const across = cross(axis, camera.axes[2]);
      const [right, up] = [dot(across, camera.axes[0]), -dot(across, camera.axes[1])];
      const radius = this.#pixels.ring * Math.hypot(right, up);
      return (u, v) => turned(pose, axis, ((u - x) * right + (v - y) * up) / (radius || 1));
    }
    const centre = camera.project(origin, width, height);
    let angle = 0;
    let last = Math.atan2(y - centre.y, x - centre.x);
    return (u, v) => {
      const now = Math.atan2(v - centre.y, u - centre.x);
      const step = now - last;
      angle += step - 2 * Math.PI * Math.round(step / (2 * Math.PI));
      last = now;
      return turned(pose, axis, -Math.sign(facing) * angle); // y goes down on the screen
    };
  }

  draw(camera, pose, { colours, ratio }) {
    const { context, canvas } = this;
    const shapes = this.#shapes(camera, pose);
    const [left, top] = [shapes.centre.x, shapes.centre.y].map((at) => Math.round(at - SIZE.room / 2));
    canvas.style.transform = `translate(${left}px, ${top}px)`;
    if (canvas.width !== SIZE.room * ratio) canvas.width = canvas.height = SIZE.room * ratio;
    context.setTransform(ratio, 0, 0, ratio, -left * ratio, -top * ratio);
    context.clearRect(left, top, SIZE.room, SIZE.room);
    context.lineCap = context.lineJoin = "round";
    const strong = (kind, axis) => this.active?.kind === kind && this.active.axis === axis;
    shapes.rings.forEach((ring, axis) => {
      for (const front of [false, true]) {
        context.beginPath();
        ring.forEach((point, i) => {
          const next = ring[(i + 1) % SIDES];
          if (point.front !== front) return;
          context.moveTo(point.x, point.y);
          context.lineTo(next.x, next.y);
        });
        context.globalAlpha = front ? 1 : 0.25;
        stroke(context, colours.halo, colours.axes[axis], strong("ring", axis) ? 5 : 2.5, front);
      }
    });
    context.globalAlpha = 1;
    shapes.arrows.forEach((end, axis) => {
      const start = part(shapes.centre, end, 0.1);
      context.beginPath();
      context.moveTo(start.x, start.y);
      context.lineTo(end.x, end.y);
      stroke(context, colours.halo, colours.axes[axis], strong("arrow", axis) ? 6 : 3.5, true);
      head(context, shapes.centre, end, colours.axes[axis], strong("arrow", axis) ? 11 : 8.5);
      const reach = Math.hypot(end.x - shapes.centre.x, end.y - shapes.centre.y);
      const label = part(shapes.centre, end, 1 + 16 / Math.max(reach, 16));
      context.font = "600 13px system-ui, sans-serif";
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.lineWidth = 3;
      context.strokeStyle = colours.halo;
      context.strokeText(AXES[axis], label.x, label.y);
      context.fillStyle = colours.axes[axis];
      context.fillText(AXES[axis], label.x, label.y);
    });
    context.beginPath();
    context.arc(shapes.centre.x, shapes.centre.y, this.active?.kind === "plane" ? 9 : 7, 0, 2 * Math.PI);
    context.fillStyle = colours.dot;
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = colours.halo;
    context.stroke();
  }

  get #pixels() {
    const factor = this.stage.clientWidth < 560 ? SIZE.narrow : 1;
    return { arrow: SIZE.arrow * factor, ring: SIZE.ring * factor };
  }

  /** Where everything is on the screen. */
  #shapes(camera, pose) {
    const [width, height] = this.#view;
    const origin = position(pose);
    const centre = camera.project(origin, width, height);
    const metre = 1 / centre.scale; // of a pixel
    const { arrow, ring } = this.#pixels;
    const directions = this.directions(pose);
    const toEye = minus(camera.eye, origin);
    const arrows = directions.map((axis) => camera.project(plus(origin, scaled(axis, arrow * metre)), width, height));
    const rings = directions.map((axis) => {
      const [u, v] = across(axis);
      return Array.from({ length: SIDES }, (_, i) => {
        const angle = (2 * Math.PI * (i + 0.5)) / SIDES;
        const out = plus(scaled(u, Math.cos(angle)), scaled(v, Math.sin(angle)));
        const seen = camera.project(plus(origin, scaled(out, ring * metre)), width, height);
        return { x: seen.x, y: seen.y, front: dot(out, toEye) > -0.02 * length(toEye) };
      });
    });
    return { centre, arrows, rings };
  }
}

function stroke(context, halo, colour, width, haloed) {
  if (haloed) {
    context.lineWidth = width + 2;
    context.strokeStyle = halo;
    context.stroke();
  }
  context.lineWidth = width;
  context.strokeStyle = colour;
  context.stroke();
}

function head(context, centre, end, colour, size) {
  const reach = Math.hypot(end.x - centre.x, end.y - centre.y);
  if (reach < 4) return;
  const [x, y] = [(end.x - centre.x) / reach, (end.y - centre.y) / reach];
  context.beginPath();
  context.moveTo(end.x + x * size, end.y + y * size);
  context.lineTo(end.x - y * size * 0.7, end.y + x * size * 0.7);
  context.lineTo(end.x + y * size * 0.7, end.y - x * size * 0.7);
  context.closePath();
  context.fillStyle = colour;
  context.fill();
}

const part = (a, b, t) => ({ x: a.x + (b.x - a.x) * t, y: a.y + (b.y - a.y) * t });

function toSegment(x, y, a, b) {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const t = Math.min(Math.max(((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1), 0), 1);
  return Math.hypot(x - a.x - t * dx, y - a.y - t * dy);
}

/** Two directions across an axis. */
function across(axis) {
  const other = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const u = cross(axis, other);
  const unit = scaled(u, 1 / length(u));
  return [unit, cross(axis, unit)];
}

/** Where a ray meets a plane; null behind the eye. */
function onPlane({ eye, along }, point, normal) {
  const t = dot(minus(point, eye), normal) / dot(along, normal);
  return t > 0 && Number.isFinite(t) ? plus(eye, scaled(along, t)) : null;
}

/** How far along a line the point is that a ray comes nearest to; null where they are nearly parallel. */
function alongLine({ eye, along }, point, axis) {
  const between = minus(point, eye);
  const b = dot(axis, along);
  const d = 1 - b * b;
  return d < 1e-3 ? null : (b * dot(along, between) - dot(axis, between)) / d;
}
