// SPDX-License-Identifier: Apache-2.0
// Draws path and map in 3D: the estimate over the ground truth, rotated by dragging.
"use strict";

const spaceOf = (() => {
  const turnStep = 0.12, zoomStep = 1.25, leastZoom = 0.5, mostZoom = 60, perPixel = 0.008, edge = 0.9;

  const square = 4, speck = 1.2, mostInView = 0.9, zoomOnMap = 1.5;
  const pointsOf = (path) => path.x.map((x, i) => [x, path.y[i], path.z[i]]);

  // Returns the order of the axes that puts the one with the least motion upright.
  function upright(points) {
    const extent = (k) => points.reduce((m, p) => Math.max(m, p[k]), -Infinity) - points.reduce((m, p) => Math.min(m, p[k]), Infinity);
    return points.length ? [0, 1, 2].sort((a, b) => extent(b) - extent(a)) : [0, 1, 2];
  }

  // Returns all points but the farthest from `middle`: a few wrong ones would make everything else small.
  function withoutFarthest(points, middle) {
    const far = (point) => Math.hypot(...point.map((value, k) => value - middle[k]));
    return [...points].sort((a, b) => far(a) - far(b)).slice(0, Math.ceil(mostInView * points.length));
  }

  // Draws `path` and `map` onto a canvas; `turned` is called with the error at the current time, and with the size of the map
  // as far as it is shown.
  return (canvas, path, map, turned) => {
    const reference = path.truth.x.length ? path.truth : path.estimate;
    const order = upright(pointsOf(reference));
    const ordered = (line) => pointsOf(line).map((p) => order.map((k) => p[k]));
    const lines = { truth: ordered(path.truth), estimate: ordered(path.estimate) };
    const points = ordered(map.points), keyframes = ordered(map.keyframes);
    const paths = [...lines.truth, ...lines.estimate];
    const { middle, radius } = viewMath.ballAround([...paths, ...withoutFarthest(points, viewMath.ballAround(paths).middle)]);
    let yaw = -0.5, pitch = 0.7, zoom = points.length ? zoomOnMap : 1, now_s = 0, drag = null, size = [0, 0], withMap = true;
    const context = canvas.getContext("2d");
    const color = (name) => getComputedStyle(canvas).getPropertyValue(name).trim();
    const pixelsPerMeter = () => (edge * Math.min(...size) * zoom) / (2 * radius);

    function place(point) {
      const [right, up] = viewMath.seen(point.map((value, k) => value - middle[k]), yaw, pitch);
      return [size[0] / 2 + right * pixelsPerMeter(), size[1] / 2 - up * pixelsPerMeter()];
    }

    function stroke(points, breaks, style, width, until = points.length) {
      const gaps = new Set(breaks);
      context.beginPath();
      for (let i = 0; i < until; i++) {
        const [x, y] = place(points[i]);
        if (i === 0 || gaps.has(i)) context.moveTo(x, y); else context.lineTo(x, y);
      }
      context.strokeStyle = style;
      context.lineWidth = width;
      context.stroke();
    }

    function draw() {
      const ratio = devicePixelRatio || 1;
      size = [canvas.clientWidth, canvas.clientHeight];
      canvas.width = size[0] * ratio;
      canvas.height = size[1] * ratio;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.lineJoin = "round";
      const made = withMap && map.t_s.length && map.t_s[0] <= now_s ? viewMath.lastBefore(map.t_s, now_s) + 1 : 0;
      const seen = made ? map.ends[made - 1] : 0;
      boxes(points, seen, color("--point"), speck);
      stroke(lines.truth, path.truth.breaks, color("--truth"), 3);
      context.globalAlpha = 0.35;
      stroke(lines.estimate, path.estimate.breaks, color("--estimate"), 1.3);
      context.globalAlpha = 1;
      const last = path.estimate.t_s.length && path.estimate.t_s[0] <= now_s ? viewMath.lastBefore(path.estimate.t_s, now_s) : -1;
      stroke(lines.estimate, path.estimate.breaks, color("--estimate"), 1.8, last + 1);
      boxes(keyframes, made, color("--keyframe"), square);
      const true_ = viewMath.lastBefore(path.truth.t_s, now_s);
      if (true_ >= 0) dot(place(lines.truth[true_]), color("--truth"), 5);
      if (last >= 0) dot(place(lines.estimate[last]), color("--here"), 5);
      axes();
      scaleBar();
      const error = last >= 0 && true_ >= 0 ? Math.hypot(...lines.estimate[last].map((v, k) => v - lines.truth[true_][k])) : null;
      turned({ error_m: error, keyframes: made, points: seen });
    }

    function boxes(all, until, style, side) {
      context.fillStyle = style;
      for (let i = 0; i < until; i++) {
        const [x, y] = place(all[i]);
        context.fillRect(x - side / 2, y - side / 2, side, side);
      }
    }

    function dot([x, y], style, r) {
      context.beginPath();
      context.arc(x, y, r, 0, 2 * Math.PI);
      context.fillStyle = style;
      context.fill();
    }

    function axes() {
      context.font = "11px sans-serif";
      order.forEach((axis, k) => {
        const unit = [0, 0, 0];
        unit[k] = 1;
        const [right, up] = viewMath.seen(unit, yaw, pitch);
        const from = [34, size[1] - 34], to = [from[0] + 22 * right, from[1] - 22 * up];
        context.beginPath();
        context.moveTo(...from);
        context.lineTo(...to);
        context.strokeStyle = color("--soft");
        context.lineWidth = 1;
        context.stroke();
        context.fillStyle = color("--soft");
        context.fillText("xyz"[axis], to[0] + 3 * Math.sign(right), to[1] - 3 * Math.sign(up));
      });
    }

    function scaleBar() {
      const step = viewMath.ticks(0, 120 / pixelsPerMeter(), 2)[1];
      if (!step) return;
      const long = step * pixelsPerMeter(), end = size[0] - 10, y = size[1] - 12;
      context.fillStyle = color("--soft");
      context.fillRect(end - long, y, long, 2);
      context.textAlign = "right";
      context.fillText(`${viewMath.short(step)} m`, end, y - 4);
      context.textAlign = "left";
    }

    function turn(right, up) { yaw += right; pitch = viewMath.clamp(pitch + up, -Math.PI / 2, Math.PI / 2); draw(); }
    function come(factor) { zoom = viewMath.clamp(zoom * factor, leastZoom, mostZoom); draw(); }

    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); drag = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointermove", (event) => {
      if (!drag) return;
      turn((drag[0] - event.clientX) * perPixel, (event.clientY - drag[1]) * perPixel);
      drag = [event.clientX, event.clientY];
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { drag = null; });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); come(event.deltaY < 0 ? zoomStep : 1 / zoomStep); }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const does = {
        ArrowLeft: () => turn(-turnStep, 0), ArrowRight: () => turn(turnStep, 0),
        ArrowUp: () => turn(0, turnStep), ArrowDown: () => turn(0, -turnStep),
        "+": () => come(zoomStep), "=": () => come(zoomStep), "-": () => come(1 / zoomStep),
      }[event.key];
      if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      does();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    new ResizeObserver(draw).observe(canvas);
    draw();
    return { at(t_s) { now_s = t_s; draw(); }, showMap(whether) { withMap = whether; draw(); } };
  };
})();
