import { cross, dot, length, minus, multiply, plus, scaled } from "./matrices.js";

/**
 * The arm and its ghosts by WebGL. It is drawn by a few hundred lines of its own rather than by a library: the shapes are a few
 * plain meshes, and a frame must be cheap where a processor draws it.
 */

const FIELD = 0.62; // [rad] of view, from top to bottom
const NEAR = 0.05;
const FAR = 20; // [m]
const GRID = { reach: 1.5, step: 0.1 }; // [m]
const BACK = { light: [0.92, 0.94, 0.96], dark: [0.125, 0.145, 0.18] };
const SAME = 1e-3; // [m], and parts of rotations
const CREASE = 0.7; // least cosine between triangles over whose edge light runs smoothly
const LOOK = { smooth: 0, flat: 1, shadow: 2 };
const SHADOW = [0.25, 0.15]; // the light comes from (-x, -y, 1) of these

/** Ghosts that are drawn at once: a place takes four of 256 vectors that every browser has for uniforms. */
const AT_ONCE = 24;
const VERTEX = `#version 300 es
  uniform mat4 camera, place[${AT_ONCE}];
  uniform vec4 colour[${AT_ONCE}];
  uniform float unit;
  layout(location = 0) in vec3 corner;
  layout(location = 1) in vec3 normal;
  out vec3 where, outward;
  flat out vec4 tint;
  void main() {
    vec4 found = place[gl_InstanceID] * vec4(corner * unit, 1.0);
    where = found.xyz;
    outward = mat3(place[gl_InstanceID]) * normal;
    tint = colour[gl_InstanceID];
    gl_Position = camera * found;
  }`;
const FRAGMENT = `#version 300 es
  precision highp float;
  uniform vec3 eye;
  uniform int look; // 0: smooth, 1: one light for each triangle, 2: black
  in vec3 where, outward;
  flat in vec4 tint;
  out vec4 seen;
  float power4(float x) { return x * x * x * x; }
  float power8(float x) { return power4(x * x); }
  void main() {
    if (look == 2) { seen = vec4(0.0, 0.0, 0.0, tint.a); return; }
    vec3 to_eye = normalize(eye - where);
    vec3 n = look == 1 ? normalize(cross(dFdx(where), dFdy(where))) : normalize(outward);
    float key = max(dot(n, normalize(vec3(-0.35, -0.25, 1.0))), 0.0);
    float fill = max(dot(n, to_eye), 0.0);
    float mirrored = max(dot(n, normalize(to_eye + normalize(vec3(-0.35, -0.25, 1.0)))), 0.0);
    float shine = power8(mirrored) * power8(power4(mirrored)); // to the power 40
    vec3 light = tint.rgb * (0.30 + 0.14 * n.z + 0.42 * key + 0.30 * fill) + 0.16 * shine;
    light += 0.18 * power4(1.0 - fill);
    seen = vec4(light * tint.a, tint.a);
  }`;
const LINE_VERTEX = `#version 300 es
  uniform mat4 camera;
  layout(location = 0) in vec3 corner;
  out vec2 where;
  void main() { where = corner.xy; gl_Position = camera * vec4(corner, 1.0); }`;
const LINE_FRAGMENT = `#version 300 es
  precision highp float;
  uniform vec4 colour;
  uniform float reach;
  in vec2 where;
  out vec4 seen;
  void main() { seen = colour * smoothstep(reach, 0.25 * reach, length(where)); }`;

/** Where one looks from, and at what. */
export class Camera {
  constructor() {
    this.turnTo(-0.75, 0.32);
    this.aspect = 1;
    this.show(1.2);
  }

  /** Look at an arm of such a reach [m]. */
  show(reach) {
    this.aim = [0, 0, 0.33 * reach];
    this.distance = 1.8 * reach;
  }

  /** Look from a direction: about z from x, and up [rad]. */
  turnTo(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = Math.min(Math.max(elevation, -0.3), 1.5);
  }

  get eye() {
    const { azimuth, elevation, distance, aim } = this;
    const flat = distance * Math.cos(elevation);
    return [
      aim[0] + flat * Math.cos(azimuth), aim[1] + flat * Math.sin(azimuth), aim[2] + distance * Math.sin(elevation),
    ];
  }

  /** Right, up and backward, of the eye. */
  get axes() {
    const back = scaled(minus(this.eye, this.aim), 1 / this.distance);
    const across = cross([0, 0, 1], back);
    const right = scaled(across, 1 / length(across));
    return [right, cross(back, right), back];
  }

  /** A narrow picture is as wide as it is high. */
  get tangent() {
    return Math.tan(FIELD / 2) * Math.max(1, 1 / this.aspect);
  }

  /** From the base to what WebGL clips, row by row. */
  get matrix() {
    const [right, up, back] = this.axes;
    const eye = this.eye;
    const view = [
      ...right, -dot(right, eye),
      ...up, -dot(up, eye),
      ...back, -dot(back, eye),
      0, 0, 0, 1,
    ];
    const f = 1 / this.tangent;
    const depth = NEAR - FAR;
    return multiply(
      [f / this.aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (FAR + NEAR) / depth, (2 * FAR * NEAR) / depth, 0, 0, -1, 0],
      view,
    );
  }

  /** Where a point is in a picture of such a size [pixel], and how far away. */
  project(point, width, height) {
    const [right, up, back] = this.axes;
    const away = minus(point, this.eye);
    const depth = -dot(away, back);
    const scale = height / (2 * this.tangent * depth);
    return { x: width / 2 + dot(away, right) * scale, y: height / 2 - dot(away, up) * scale, depth, scale };
  }

  /** The direction of what is seen at a pixel. */
  ray(x, y, width, height) {
    const [right, up, back] = this.axes;
    const scale = (2 * this.tangent) / height;
    const [u, v] = [(x - width / 2) * scale, (height / 2 - y) * scale];
    const along = [0, 1, 2].map((i) => right[i] * u + up[i] * v - back[i]);
    return scaled(along, 1 / length(along));
  }
}

export class Stage {
  #gl;
  #solid;
  #line;
  #grid;
  #robots = new WeakMap(); // buffers

  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: false, stencil: true, alpha: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.#gl = gl;
    this.#solid = program(gl, VERTEX, FRAGMENT, ["camera", "place", "unit", "eye", "colour", "look"]);
    this.#line = program(gl, LINE_VERTEX, LINE_FRAGMENT, ["camera", "colour", "reach"]);
    this.#grid = gridLines(gl);
  }

  /** Make the buffers of a robot, once. */
  add(robot) {
    if (this.#robots.has(robot)) return;
    const gl = this.#gl;
    const coloured = (pieces, lit) =>
      pieces.map((piece) => ({ colour: piece.colour.map((each) => each / 255), ...mesh(gl, lit(piece)) }));
    const buffers = robot.parts.map(({ pieces, light, plain }) => ({
      fine: { pieces: pieces && coloured(pieces, smooth), whole: plain && mesh(gl, plain) },
      coarse: { pieces: coloured(light, creased), whole: light.length ? mesh(gl, joined(light)) : null },
    }));
    this.#robots.set(robot, { unit: robot.step, buffers });
  }

  /**
   * Draw a frame.
   *
   * @param {Camera} camera
   * @param {{ robot: object, places: number[][], dark: boolean, ghosts: object[], coarse?: boolean }} scene
   *   `places` of what each joint moves; a ghost is `{ places, colour }`, of four numbers in 0..1. What is coarse has
   *   few triangles, and its ghosts are drawn once, and may show their inside.
   */
  draw(camera, { robot, places, dark, ghosts, coarse = false }) {
    const gl = this.#gl;
    const { unit, buffers } = this.#robots.get(robot);
    const parts = buffers.map((part) => part[coarse || robot.own ? "coarse" : "fine"]);
    const matrix = camera.matrix;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...(dark ? BACK.dark : BACK.light), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.#drawGrid(matrix, dark);

    gl.useProgram(this.#solid.program);
    const at = this.#solid.at;
    gl.uniformMatrix4fv(at.camera, true, matrix);
    gl.uniform3fv(at.eye, camera.eye);
    gl.uniform1f(at.unit, unit);
    this.#drawShadow(parts, places, dark);

    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    gl.uniform1i(at.look, LOOK.smooth);
    parts.forEach(({ pieces }, part) => {
      for (const piece of pieces) this.#drawMesh(piece, [places[part]], [[...shown(piece.colour, dark), 1]]);
    });
    gl.uniform1i(at.look, LOOK.flat);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    if (!coarse) {
      // First how near ghosts are, then the nearest surface alone, so that none shows its own inside.
      gl.colorMask(false, false, false, false);
      this.#drawPlain(parts, ghosts, places);
      gl.colorMask(true, true, true, true);
      gl.depthFunc(gl.LEQUAL);
    }
    gl.enable(gl.BLEND);
    this.#drawPlain(parts, ghosts, places);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.depthFunc(gl.LESS);
    gl.disable(gl.CULL_FACE);
  }

  /** Arms `{ places, colour }` by plain shapes: each part of all of them at once, but where the arm's own is. */
  #drawPlain(parts, arms, own = null) {
    parts.forEach(({ whole }, part) => {
      const isOwn = ({ places }) => own && places[part].every((value, i) => Math.abs(value - own[part][i]) < SAME);
      const shown = whole ? arms.filter((arm) => !isOwn(arm)) : [];
      for (let first = 0; first < shown.length; first += AT_ONCE) {
        const some = shown.slice(first, first + AT_ONCE);
        this.#drawMesh(whole, some.map(({ places }) => places[part]), some.map(({ colour }) => colour));
      }
    });
  }

  /** A mesh at several places, each in its colour. */
  #drawMesh({ array, count }, places, colours) {
    const gl = this.#gl;
    gl.uniformMatrix4fv(this.#solid.at.place, true, places.flat());
    gl.uniform4fv(this.#solid.at.colour, colours.flat());
    gl.bindVertexArray(array);
    gl.drawElementsInstanced(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0, places.length);
  }

  /** On the floor, each point once. */
  #drawShadow(parts, places, dark) {
    const gl = this.#gl;
    const [x, y] = SHADOW;
    const onFloor = [1, 0, x, 0, 0, 1, y, 0, 0, 0, 0, 0, 0, 0, 0, 1];
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.uniform1i(this.#solid.at.look, LOOK.shadow);
    const colour = [0, 0, 0, dark ? 0.4 : 0.14];
    this.#drawPlain(parts, [{ places: places.map((place) => multiply(onFloor, place)), colour }]);
    gl.disable(gl.STENCIL_TEST);
    gl.disable(gl.BLEND);
  }

  #drawGrid(matrix, dark) {
    const gl = this.#gl;
    gl.useProgram(this.#line.program);
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.uniformMatrix4fv(this.#line.at.camera, true, matrix);
    gl.uniform1f(this.#line.at.reach, GRID.reach);
    const grey = dark ? 0.9 : 0.2;
    const alpha = dark ? 0.22 : 0.25;
    gl.uniform4fv(this.#line.at.colour, [grey * alpha, grey * alpha, grey * alpha, alpha]);
    gl.bindVertexArray(this.#grid.array);
    gl.drawArrays(gl.LINES, 0, this.#grid.count);
    gl.disable(gl.BLEND);
  }
}

/** What is nearly black is seen on a dark page, too. */
function shown(colour, dark) {
  const floor = dark ? 0.3 : 0.16;
  return colour.map((each) => floor + (1 - floor) * each);
}

function program(gl, vertex, fragment, names) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return { program: made, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
}

/** Buffers of triangles, some with a normal at each corner. */
function mesh(gl, { vertices, faces, normals = null }) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  fill(gl, 0, new Int16Array(vertices), gl.SHORT);
  if (normals) fill(gl, 1, new Float32Array(normals), gl.FLOAT);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(faces), gl.STATIC_DRAW);
  gl.bindVertexArray(null);
  return { array, count: faces.length };
}

function fill(gl, location, values, kind) {
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(location);
  gl.vertexAttribPointer(location, 3, kind, false, 0, 0);
}

/** A mesh whose normals are the sum of those of the triangles around, by their areas. */
function smooth({ vertices, faces }) {
  const normals = new Float32Array(vertices.length);
  faceNormals(vertices, faces).forEach((normal, face) => {
    for (const index of faces.slice(3 * face, 3 * face + 3)) for (let k = 0; k < 3; k++) normals[3 * index + k] += normal[k];
  });
  return { vertices, faces, normals };
}

/** A mesh that is smooth but for its sharp edges; triangles share no corners. */
function creased({ vertices, faces }) {
  const corners = faces.map((index) => vertices.slice(3 * index, 3 * index + 3));
  const directions = faceNormals(vertices, faces).map((normal) => scaled(normal, 1 / (length(normal) || 1)));
  const at = (i) => directions[Math.floor(i / 3)];
  const around = new Map(); // corners of triangles, by the corner of the mesh that they are at
  faces.forEach((index, i) => around.set(index, [...(around.get(index) ?? []), i]));
  const weights = corners.map((corner, i) => {
    const first = i - (i % 3);
    const [a, b] = [1, 2].map((step) => minus(corners[first + ((i + step) % 3)], corner));
    // The angle at the corner: both halves of a square count as one.
    return Math.acos(Math.min(Math.max(dot(a, b) / (length(a) * length(b) || 1), -1), 1));
  });
  const normals = faces.flatMap((index, i) => {
    const near = around.get(index).filter((other) => dot(at(other), at(i)) > CREASE);
    return near.map((other) => scaled(at(other), weights[other])).reduce(plus, [0, 0, 0]);
  });
  return { vertices: corners.flat(), faces: faces.map((_, i) => i), normals };
}

/** The normal of each triangle, as long as twice its area. */
function faceNormals(vertices, faces) {
  const corner = (index) => vertices.slice(3 * index, 3 * index + 3);
  return Array.from({ length: faces.length / 3 }, (_, face) => {
    const [a, b, c] = faces.slice(3 * face, 3 * face + 3).map(corner);
    return cross(minus(b, a), minus(c, a));
  });
}

/** Several meshes as one. */
function joined(meshes) {
  const vertices = [];
  const faces = [];
  for (const each of meshes) {
    const first = vertices.length / 3;
    vertices.push(...each.vertices);
    faces.push(...each.faces.map((index) => index + first));
  }
  return { vertices, faces };
}

function gridLines(gl) {
  const corners = [];
  const { reach, step } = GRID;
  for (let at = -reach; at < reach + step / 2; at += step) {
    corners.push(-reach, at, 0, reach, at, 0, at, -reach, 0, at, reach, 0);
  }
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  fill(gl, 0, new Float32Array(corners), gl.FLOAT);
  gl.bindVertexArray(null);
  return { array, count: corners.length / 3 };
}
