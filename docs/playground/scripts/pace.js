/** How finely to draw while things move: as finely as this machine does 50 frames a second. */

/** Drawn pixels to one of the page, along an edge, in steps; frames that take longer than `slow` [ms] make them fewer. */
const SHARPNESS = { least: 0.5, coarse: 0.8, whole: 1, most: 2, slow: 20, gain: 1.02, step: 1 / 8 };

export class Pace {
  /** Few triangles are drawn, and no more pixels than the page has, until the page is at rest. */
  coarse = false;
  #sharpness = SHARPNESS.whole;
  #last = null; // when the last frame was drawn while things moved [ms]

  /** Before a frame at a time [ms]: how many pixels it has, to a pixel of the page. All of them where nothing moves. */
  sharpness(now, still) {
    const taken = this.#last === null ? null : now - this.#last;
    this.#last = still ? null : now;
    if (taken !== null) this.#judge(taken); // else nothing moved before
    if (!still) return Math.round(this.#sharpness / SHARPNESS.step) * SHARPNESS.step;
    if (this.#sharpness >= SHARPNESS.whole) this.coarse = false;
    return SHARPNESS.most;
  }

  #judge(taken) {
    const { slow, least, whole, most, gain, coarse } = SHARPNESS;
    const factor = taken > slow ? Math.sqrt(Math.max(slow / taken, 0.5)) : gain;
    this.#sharpness = Math.min(Math.max(this.#sharpness * factor, least), this.coarse ? whole : most);
    if (this.#sharpness < coarse) this.coarse = true;
  }
}
