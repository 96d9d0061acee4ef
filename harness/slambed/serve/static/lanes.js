// SPDX-License-Identifier: Apache-2.0
// Draws the timeline of a run: states and events, then a lane per kind of curve, over run time.
"use strict";

const lanesOf = (() => {
  const svgNamespace = "http://www.w3.org/2000/svg";
  const lanes = ["tracking", "RTT", "CPU", "throttled"];
  const left = 52, right = 8, top = 6, stateHeight = 16, marksHeight = 22, laneHeight = 62, gap = 22, axisHeight = 20;
  const leastWindow_s = 0.2, dragFrom_px = 6, zoomStep = 1.5, moveShare = 0.2;
  const markRow = { loss: 0, found: 0, state: 0, loop: 0, link: 0, refused: 1, update: 1, keyframe: 1 };

  function element(parent, name, attributes, text) {
    const made = document.createElementNS(svgNamespace, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    parent.appendChild(made);
    return made;
  }

  const named = (parent, name, attributes, says) => element(element(parent, name, attributes), "title", {}, says);

  // Draws `run` into `container`; `pick` is called with the run time of a click.
  return (container, run, pick) => {
    const whole = [0, run.end_s];
    let shown = whole, now_s = 0, width = 0, cursor = null, drag = null;
    const used = lanes.filter((lane) => run.series.some((curve) => curve.lane === lane));
    const height = top + stateHeight + marksHeight + used.length * (laneHeight + gap) + axisHeight;
    const svg = element(container, "svg", { class: "lanes", height, "aria-hidden": "true" });
    const x = (t) => left + (width - left - right) * viewMath.placeOf(t, shown);
    const timeAt = (px) => viewMath.valueAt((px - left) / (width - left - right), shown);
    const inside = (begin_s, end_s) => end_s >= shown[0] && begin_s <= shown[1];
    const clampX = (px) => viewMath.clamp(px, left, width - right);

    function box(parent, begin_s, end_s, y, high, name, says) {
      const from = clampX(x(begin_s)), to = clampX(x(end_s));
      named(parent, "rect", { x: from, y, width: Math.max(to - from, 0.8), height: high, class: name }, says);
    }

    function draw() {
      width = Math.max(container.clientWidth, 240);
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("width", width);
      svg.replaceChildren();
      const bottom = height - axisHeight;
      for (const fault of run.faults.filter((f) => inside(f.begin_s, f.end_s))) {
        box(svg, fault.begin_s, fault.end_s, top, bottom - top, `fault ${fault.fault}`, `${fault.target}: ${fault.fault}`);
      }
      element(svg, "text", { x: 0, y: top + 12, class: "name" }, "state");
      for (const stretch of run.stretches.filter((s) => inside(s.begin_s, s.end_s))) {
        box(svg, stretch.begin_s, stretch.end_s, top, stateHeight, `state ${stretch.state}`,
          `${stretch.state.replace("_", " ")} from ${stretch.begin_s.toFixed(2)} s`);
      }
      marks(top + stateHeight);
      used.forEach((lane, i) => curves(lane, top + stateHeight + marksHeight + i * (laneHeight + gap) + gap - 6));
      const places = viewMath.ticks(...shown, (width - left) / 90);
      const step = places.length > 1 ? places[1] - places[0] : 1;
      for (const t of places) {
        element(svg, "line", { x1: x(t), x2: x(t), y1: bottom, y2: bottom + 4, class: "axis" });
        element(svg, "text", { x: x(t), y: height - 4, class: "time" }, `${viewMath.written(t, step)} s`);
      }
      cursor = element(svg, "line", { y1: 0, y2: bottom, class: "cursor" });
      placeCursor();
    }

    function marks(y) {
      for (const mark of run.marks) {
        if (!inside(mark.t_s, mark.t_s)) continue;
        const row = markRow[mark.kind] ?? 0, from = y + 2 + row * 9;
        named(svg, "line", { x1: x(mark.t_s), x2: x(mark.t_s), y1: from, y2: from + 8, class: `mark ${mark.kind}` },
          `${mark.says} at ${mark.t_s.toFixed(2)} s`);
      }
    }

    function curves(lane, y) {
      const own = run.series.filter((curve) => curve.lane === lane);
      const values = own.flatMap((c) => c.value.filter((_, i) => inside(c.t_s[i], c.t_s[i])));
      const most = values.reduce((a, b) => Math.max(a, b), 0) || 1;
      element(svg, "text", { x: 0, y: y + laneHeight / 2 + 4, class: "name" }, lane);
      element(svg, "text", { x: left - 4, y: y + 9, class: "tick" }, viewMath.short(most));
      element(svg, "text", { x: left - 4, y: y + laneHeight, class: "tick" }, "0");
      element(svg, "line", { x1: left, x2: width - right, y1: y + laneHeight, y2: y + laneHeight, class: "axis" });
      const legend = element(svg, "text", { x: left, y: y - 3, class: "legend" });
      own.forEach((curve, i) => element(legend, "tspan", { class: `curve-${i}` }, `${i ? ",  " : ""}${curve.name} [${curve.unit}]`));
      own.forEach((curve, i) => {
        // Includes one point beyond each end, so that the line extends to the edge.
        const first = Math.max(0, viewMath.lastBefore(curve.t_s, shown[0]));
        const last = Math.min(curve.t_s.length - 1, viewMath.lastBefore(curve.t_s, shown[1]) + 1);
        let points = "";
        for (let k = first; k <= last; k++) {
          points += `${clampX(x(curve.t_s[k])).toFixed(1)},${(y + laneHeight * (1 - curve.value[k] / most)).toFixed(1)} `;
        }
        element(svg, "polyline", { points, class: `curve curve-${i}` });
      });
    }

    function placeCursor() {
      if (!cursor) return;
      const seen = now_s >= shown[0] && now_s <= shown[1];
      cursor.setAttribute("visibility", seen ? "visible" : "hidden");
      cursor.setAttribute("x1", x(now_s));
      cursor.setAttribute("x2", x(now_s));
    }

    function show(next) { shown = next; draw(); }
    const zoom = (at, factor) => show(viewMath.zoomed(shown, at, factor, whole, leastWindow_s));
    const move = (share) => show(viewMath.shifted(shown, share * (shown[1] - shown[0]), whole));
    const pointer_px = (event) => event.clientX - svg.getBoundingClientRect().left;

    svg.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoom(timeAt(pointer_px(event)), event.deltaY < 0 ? zoomStep : 1 / zoomStep);
    }, { passive: false });
    svg.addEventListener("dblclick", () => show(whole));
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      drag = { from: pointer_px(event), band: element(svg, "rect", { y: 0, height: height - axisHeight, class: "band" }) };
    });
    svg.addEventListener("pointermove", (event) => {
      if (!drag) return;
      const to = pointer_px(event);
      drag.band.setAttribute("x", Math.min(drag.from, to));
      drag.band.setAttribute("width", Math.abs(to - drag.from));
    });
    svg.addEventListener("pointerup", (event) => {
      if (!drag) return;
      const { from } = drag, to = pointer_px(event);
      drag.band.remove();
      drag = null;
      const times = [timeAt(Math.min(from, to)), timeAt(Math.max(from, to))];
      if (Math.abs(to - from) < dragFrom_px) pick(viewMath.clamp(timeAt(to), ...whole));
      else if (times[1] - times[0] >= leastWindow_s) show([Math.max(times[0], 0), Math.min(times[1], run.end_s)]);
    });
    svg.addEventListener("pointercancel", () => { if (drag) drag.band.remove(); drag = null; });
    container.addEventListener("keydown", (event) => {
      const does = {
        "+": () => zoom(now_s, zoomStep), "=": () => zoom(now_s, zoomStep), "-": () => zoom(now_s, 1 / zoomStep),
        0: () => show(whole), ArrowLeft: () => move(-moveShare), ArrowRight: () => move(moveShare),
      }[event.key];
      if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      does();
    });
    new ResizeObserver(() => { if (container.clientWidth !== width) draw(); }).observe(container);
    draw();
    return { at(t_s) { now_s = t_s; placeCursor(); } };
  };
})();
