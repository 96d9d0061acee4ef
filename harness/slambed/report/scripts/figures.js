// SPDX-License-Identifier: Apache-2.0
// Figures of a page: values under the pointer or by arrow keys, and a closer look. The picture itself stays
// as it is drawn; without this script, and on paper, nothing is different.
"use strict";

(() => {
  const reach_px = 28, dragFrom_px = 8, zoomStep = 1.5, closest = 1 / 24, moveShare = 0.15, tickEvery_px = 90;
  const svgNamespace = "http://www.w3.org/2000/svg";
  const help = "plus and minus look closer, arrows go from value to value, with shift they move, 0 shows all";

  function make(parent, name, className, text) {
    const made = name === "div" ? document.createElement(name) : document.createElementNS(svgNamespace, name);
    made.setAttribute("class", className);
    if (text !== undefined) made.textContent = text;
    parent.appendChild(made);
    return made;
  }

  // Where a value is in the picture, as shares of its width and height.
  const across = (axes, value) => axes.box[0] + (axes.box[2] - axes.box[0]) * viewMath.placeOf(value, axes.x.limits, axes.x.scale);
  const down = (axes, value) => axes.box[3] - (axes.box[3] - axes.box[1]) * viewMath.placeOf(value, axes.y.limits, axes.y.scale);

  function named(scale, value) {
    let best = null;
    for (const [at, name] of scale.names) {
      if (Math.abs(at - value) <= 0.5 && (!best || Math.abs(at - value) < Math.abs(best[0] - value))) best = [at, name];
    }
    return best && best[1];
  }

  const said = (scale, value) => named(scale, value) ?? `${scale.label || "value"}: ${viewMath.short(value)}`;

  // Everything that can be pointed at: where, and what it says.
  function targets(points) {
    const found = [];
    for (const axes of points.axes) {
      axes.curves.forEach((curve) => curve.x.forEach((x, i) => found.push({
        across: across(axes, x), down: down(axes, curve.y[i]), color: curve.color, curve,
        says: [curve.name, said(axes.x, x), said(axes.y, curve.y[i]),
          curve.value && `${curve.value.label}: ${viewMath.short(curve.value.of[i])}`],
      })));
      for (const bar of axes.bars) {
        const middle = (bar.y[0] + bar.y[1]) / 2;
        found.push({
          across: across(axes, bar.x[1]), down: down(axes, middle), color: "#000000", curve: axes.bars,
          box: [across(axes, bar.x[0]), down(axes, bar.y[1]), across(axes, bar.x[1]), down(axes, bar.y[0])].map(Number),
          says: [bar.name, `${axes.x.label || "value"}: ${viewMath.short(bar.value)}`, said(axes.y, middle)],
        });
      }
    }
    return found;
  }

  function attach(figure, points) {
    const picture = figure.querySelector("img");
    const frame = document.createElement("div");
    frame.className = "frame";
    frame.tabIndex = 0;
    frame.setAttribute("role", "group");
    frame.setAttribute("aria-label", `${picture.alt}: ${help}`);
    picture.replaceWith(frame);
    frame.appendChild(picture);
    const layer = make(frame, "svg", "layer");
    layer.setAttribute("aria-hidden", "true");
    const tip = make(frame, "div", "tip");
    tip.setAttribute("role", "status");
    tip.hidden = true;
    const all = targets(points);
    const whole = [0, 1];
    let wide = whole, high = whole, chosen = null, drag = null;

    const size = () => [frame.clientWidth, frame.clientHeight];
    const isClose = () => wide[1] - wide[0] < 0.999;
    const xOf = (share) => size()[0] * viewMath.placeOf(share, wide);
    const yOf = (share) => size()[1] * viewMath.placeOf(share, high);
    const shareAt = (px, py) => [viewMath.valueAt(px / size()[0], wide), viewMath.valueAt(py / size()[1], high)];

    function draw() {
      const scale = 1 / (wide[1] - wide[0]);
      picture.style.width = `${100 * scale}%`;
      picture.style.marginLeft = `${-100 * scale * wide[0]}%`;
      // The frame keeps the height that the whole picture has.
      frame.style.aspectRatio = picture.naturalWidth ? `${picture.naturalWidth} / ${picture.naturalHeight}` : "";
      picture.style.marginTop = `${-scale * high[0] * size()[1]}px`;
      frame.classList.toggle("close", isClose());
      layer.replaceChildren();
      if (isClose()) ticks();
      mark();
    }

    // Scales of the axes in the middle of the view, along its edges, where the picture's own are out of sight.
    function ticks() {
      const [mx, my] = [(wide[0] + wide[1]) / 2, (high[0] + high[1]) / 2];
      const axes = points.axes.find((a) => a.box[0] <= mx && mx <= a.box[2] && a.box[1] <= my && my <= a.box[3]);
      if (!axes) return;
      const [width, height] = size();
      const valueAcross = (share) => viewMath.valueAt((share - axes.box[0]) / (axes.box[2] - axes.box[0]), axes.x.limits, axes.x.scale);
      const valueDown = (share) => viewMath.valueAt((axes.box[3] - share) / (axes.box[3] - axes.box[1]), axes.y.limits, axes.y.scale);
      const along = (values, count, put) => {
        const [low, high_] = [Math.min(...values), Math.max(...values)];
        const places = viewMath.ticks(low, high_, count);
        const step = places.length > 1 ? places[1] - places[0] : high_ - low;
        for (const value of places) put(value, viewMath.written(value, step));
      };
      const within = (value, [a, b]) => between(value, a, b);
      if (!axes.x.names.length && high[1] < axes.box[3]) {
        along(wide.map(valueAcross), width / tickEvery_px, (value, text) => {
          if (!within(value, axes.x.limits)) return;
          const made = make(layer, "text", "scale", text);
          made.setAttribute("x", xOf(across(axes, value)));
          made.setAttribute("y", height - 5);
          made.setAttribute("text-anchor", "middle");
        });
      }
      if (wide[0] <= axes.box[0]) return;
      const put = (value, text) => {
        const y = yOf(down(axes, value));
        if (y < 8 || y > height - 16 || !within(value, axes.y.limits)) return;
        const made = make(layer, "text", "scale", text);
        made.setAttribute("x", 4);
        made.setAttribute("y", y + 4);
      };
      if (axes.y.names.length) axes.y.names.forEach(([at, name]) => put(at, name));
      else along(high.map(valueDown), height / tickEvery_px, put);
    }

    function mark() {
      tip.hidden = !chosen;
      if (!chosen) return;
      const [x, y] = [xOf(chosen.across), yOf(chosen.down)];
      const dot = make(layer, "circle", "here");
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", y);
      dot.setAttribute("r", 5);
      tip.replaceChildren(...chosen.says.filter(Boolean).map((line) => Object.assign(document.createElement("span"), { textContent: line })));
      const [width, height] = size();
      tip.style.left = `${viewMath.clamp(x + 12, 0, Math.max(0, width - tip.offsetWidth))}px`;
      tip.style.top = `${viewMath.clamp(y - tip.offsetHeight - 8, 0, Math.max(0, height - tip.offsetHeight))}px`;
    }

    function choose(target) { chosen = target; draw(); }

    function under(px, py) {
      const i = viewMath.nearest(all.map((t) => xOf(t.across)), all.map((t) => yOf(t.down)), px, py, reach_px);
      if (i >= 0 && !all[i].box) return all[i];
      const [ax, dn] = shareAt(px, py);
      const bar = all.find((t) => t.box && between(ax, t.box[0], t.box[2]) && between(dn, t.box[1], t.box[3]));
      return bar ?? (i >= 0 ? all[i] : null);
    }
    const between = (value, a, b) => value >= Math.min(a, b) && value <= Math.max(a, b);

    function zoom([ax, dn], factor) {
      wide = viewMath.zoomed(wide, ax, factor, whole, closest);
      high = viewMath.zoomed(high, dn, factor, whole, closest);
      draw();
    }
    function move(right, lower) {
      wide = viewMath.shifted(wide, right * (wide[1] - wide[0]), whole);
      high = viewMath.shifted(high, lower * (high[1] - high[0]), whole);
      draw();
    }
    function showAll() { wide = high = whole; draw(); }

    const inTheMiddle = () => viewMath.nearest(all.map((t) => t.across), all.map((t) => t.down), ...middle(), 1);

    // The next value of the same curve, or the first of the next curve.
    function step(by, toOther) {
      if (!all.length) return;
      let i = chosen ? all.indexOf(chosen) : -1;
      if (i < 0) i = isClose() ? Math.max(0, inTheMiddle()) : 0;
      else if (!toOther) i = viewMath.clamp(i + by, 0, all.length - 1);
      else {
        const curve = all[i].curve;
        while (all[i + by] && all[i].curve === curve) i += by;
      }
      chosen = all[i];
      const [ax, dn] = [chosen.across, chosen.down];
      if (!between(ax, ...wide)) wide = viewMath.shifted(wide, ax - (wide[0] + wide[1]) / 2, whole);
      if (!between(dn, ...high)) high = viewMath.shifted(high, dn - (high[0] + high[1]) / 2, whole);
      draw();
    }

    const at = (event) => { const box = frame.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    const middle = () => (chosen ? [chosen.across, chosen.down] : [(wide[0] + wide[1]) / 2, (high[0] + high[1]) / 2]);

    frame.addEventListener("pointermove", (event) => {
      const [px, py] = at(event);
      if (!drag) { choose(under(px, py)); return; }
      if (drag.band) {
        const [x, y] = [Math.min(px, drag.from[0]), Math.min(py, drag.from[1])];
        for (const [key, value] of Object.entries({ x, y, width: Math.abs(px - drag.from[0]), height: Math.abs(py - drag.from[1]) })) drag.band.setAttribute(key, value);
      } else {
        move((drag.last[0] - px) / size()[0], (drag.last[1] - py) / size()[1]);
        drag.last = [px, py];
      }
    });
    frame.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      frame.focus({ preventScroll: true });
      frame.setPointerCapture(event.pointerId);
      choose(null);
      drag = { from: at(event), last: at(event), band: isClose() || event.pointerType === "touch" ? null : make(layer, "rect", "band") };
      event.preventDefault();
    });
    frame.addEventListener("pointerup", (event) => {
      if (!drag) return;
      const { from, band } = drag, to = at(event);
      drag = null;
      if (band) band.remove();
      const moved = Math.max(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1]));
      if (moved < dragFrom_px) { choose(under(...to)); return; }
      if (!band) return;
      const [a, b] = [shareAt(...from), shareAt(...to)];
      zoom([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], 1);
      const factor = 1 / Math.max(Math.abs(a[0] - b[0]), Math.abs(a[1] - b[1]));
      const half = 0.5 / viewMath.clamp(factor, 1, 1 / closest);
      const around = (m) => viewMath.shifted([m - half, m + half], 0, whole);
      wide = around((a[0] + b[0]) / 2);
      high = around((a[1] + b[1]) / 2);
      draw();
    });
    frame.addEventListener("pointercancel", () => { if (drag && drag.band) drag.band.remove(); drag = null; });
    frame.addEventListener("pointerleave", () => { if (!drag) choose(null); });
    frame.addEventListener("dblclick", showAll);
    frame.addEventListener("wheel", (event) => {
      // A page is scrolled past its figures; the one that was clicked, or with Ctrl, looks closer.
      if (!event.ctrlKey && document.activeElement !== frame) return;
      event.preventDefault();
      zoom(shareAt(...at(event)), event.deltaY < 0 ? zoomStep : 1 / zoomStep);
    }, { passive: false });
    frame.addEventListener("keydown", (event) => {
      const go = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      const does = {
        "+": () => zoom(middle(), zoomStep), "=": () => zoom(middle(), zoomStep),
        "-": () => zoom(middle(), 1 / zoomStep), 0: showAll, Escape: () => choose(null),
      }[event.key];
      if (event.ctrlKey || event.metaKey || event.altKey || !(go || does)) return;
      event.preventDefault();
      if (does) does();
      else if (event.shiftKey) move(moveShare * go[0], moveShare * go[1]);
      else step(go[0] || go[1], go[1] !== 0);
    });
    frame.addEventListener("blur", () => choose(null));
    new ResizeObserver(draw).observe(frame);
    if (!picture.complete) picture.addEventListener("load", draw);
    draw();
  }

  // Points stand in the page, or in a file that is asked for when somebody comes near.
  async function begin(figure) {
    if (figure.dataset.points === "taken") return;
    const inside = figure.querySelector("script.points");
    const address = figure.dataset.points;
    figure.dataset.points = "taken";
    if (inside) { attach(figure, JSON.parse(inside.textContent)); return; }
    const answer = await fetch(address);
    if (answer.ok) attach(figure, await answer.json());
  }

  function look() {
    const near = new IntersectionObserver((entries) => {
      for (const entry of entries) if (entry.isIntersecting) { near.unobserve(entry.target); begin(entry.target); }
    }, { rootMargin: "200px" });
    for (const figure of document.querySelectorAll("figure[data-points]")) near.observe(figure);
  }

  document.documentElement.classList.add("scripted");
  document.addEventListener("renewed", look);
  look();
})();
