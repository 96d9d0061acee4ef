// SPDX-License-Identifier: Apache-2.0
// Draws the features of the frame in hand over its picture.
"use strict";

// `box` is the check box that shows and hides them. `at(index)` asks for a frame's features, one at a time and the newest last, so
// that the browser does not fall behind.
const featuresOf = (canvas, box) => {
  const smallest = 1.6, perOctave = 0.45;
  let shown = null, index = null, loading = false;

  function draw() {
    canvas.hidden = !box.checked || shown === null;
    canvas.dataset.frame = shown === null ? "" : shown.frame;
    if (canvas.hidden) return;  // what is hidden has no size
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    // The picture keeps its proportions inside of its frame.
    const scale = Math.min(width / shown.width, height / shown.height);
    const left = (width - scale * shown.width) / 2, top = (height - scale * shown.height) / 2;
    const color = (name) => getComputedStyle(canvas).getPropertyValue(name).trim();
    for (const near of [false, true]) {
      context.strokeStyle = color(near ? "--near" : "--far");
      context.beginPath();
      for (let i = 0; i < shown.u.length; i++) {
        if (shown.near[i] !== near) continue;
        const r = smallest + perOctave * shown.octave[i];
        const x = left + scale * shown.u[i], y = top + scale * shown.v[i];
        context.moveTo(x + r, y);
        context.arc(x, y, r, 0, 2 * Math.PI);
      }
      context.stroke();
    }
  }

  async function load() {
    if (loading || !box.checked || index === null || (shown !== null && shown.frame === index)) return;
    loading = true;
    const wanted = index;
    try {
      const answer = await fetch(`features/${wanted}.json`);
      shown = answer.ok ? { frame: wanted, ...(await answer.json()) } : null;
    } catch { shown = null; }
    loading = false;
    draw();
    if (index !== wanted) load();
  }

  box.addEventListener("change", () => { draw(); load(); });
  new ResizeObserver(draw).observe(canvas.parentElement);
  return { at(next) { index = next; load(); } };
};
