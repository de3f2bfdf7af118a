"""A map as a page for the browser that turns by itself and by the mouse; it loads nothing from elsewhere."""

from __future__ import annotations

import html

import orjson

from jacokin.arrays import Array

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>@TITLE@</title>
<style>body{margin:0;background:#111;color:#ddd;font:14px sans-serif}canvas{display:block}
p{position:absolute;margin:10px}</style></head>
<body><p>@TITLE@<br>drag to turn, wheel to zoom; colour: fraction of orientations reached (dark 0, bright 1)</p>
<canvas id="view"></canvas><script>
const data = @DATA@;
const canvas = document.getElementById("view"), pen = canvas.getContext("2d");
let turn = 0.6, tilt = 0.35, zoom = 1, moving = true, held = null;
const stops = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
function colour(value) {
  const place = Math.min(value * 4, 3.999), low = stops[Math.floor(place)], high = stops[Math.floor(place) + 1];
  return "rgb(" + low.map((part, i) => Math.round(part + (high[i] - part) * (place % 1))).join(",") + ")";
}
const colours = data.values.map(colour);
const low = [0, 1, 2].map(i => Math.min(...data.points.map(p => p[i])));
const high = [0, 1, 2].map(i => Math.max(...data.points.map(p => p[i])));
const centre = low.map((value, i) => (value + high[i]) / 2), size = Math.max(...low.map((value, i) => high[i] - value));
function draw() {
  canvas.width = innerWidth; canvas.height = innerHeight;
  const scale = zoom * Math.min(canvas.width, canvas.height) / (1.3 * size);
  const c = Math.cos(turn), s = Math.sin(turn), ct = Math.cos(tilt), st = Math.sin(tilt);
  const seen = data.points.map((p, i) => {
    const x = p[0] - centre[0], y = p[1] - centre[1], z = p[2] - centre[2];
    const across = c * x - s * y, away = s * x + c * y;
    return [across, ct * z + st * away, ct * away - st * z, i];
  }).sort((a, b) => b[2] - a[2]);
  const side = Math.max(1, 0.55 * data.spacing * scale);
  for (const [x, y, , i] of seen) {
    pen.fillStyle = colours[i];
    pen.fillRect(canvas.width / 2 + scale * x - side / 2, canvas.height / 2 - scale * y - side / 2, side, side);
  }
  if (moving) { turn += 0.004; requestAnimationFrame(draw); }
}
canvas.onpointerdown = event => { moving = false; held = [event.clientX, event.clientY]; };
canvas.onpointermove = event => {
  if (!held) return;
  turn += 0.01 * (event.clientX - held[0]); tilt += 0.01 * (event.clientY - held[1]);
  held = [event.clientX, event.clientY]; draw();
};
onpointerup = () => { held = null; };
canvas.onwheel = event => { zoom *= Math.exp(-0.001 * event.deltaY); event.preventDefault(); if (!moving) draw(); };
onresize = () => { if (!moving) draw(); };
draw();
</script></body></html>
"""


def page(title: str, points: Array, values: Array, spacing: float) -> str:
    """The page.

    Args:
        title: what is shown.
        points: (n, 3) centres of cells [m].
        values: (n,) fraction reached in each.
        spacing: length of an edge of a cell [m].
    """
    data = {"points": points.round(4).tolist(), "values": values.round(3).tolist(), "spacing": spacing}
    return _PAGE.replace("@TITLE@", html.escape(title)).replace("@DATA@", orjson.dumps(data).decode())
