// SPDX-License-Identifier: Apache-2.0
// Lanes over time: values under the pointer or by arrow keys, a closer look, and links that open what they lead to.
// Without this script the picture is the same, with tooltips and links.
"use strict";

(() => {
  const zoomStep = 1.5, moveShare = 0.2, stepShare = 0.01, leastWindow_s = 0.2, dragFrom_px = 8, tickEvery_px = 80;
  const svgNamespace = "http://www.w3.org/2000/svg";
  const help = "plus and minus look closer, arrows read values, with shift they move, 0 shows all";

  // Opens the folded part of the page that an address leads to.
  function unfold() {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    for (let part = target.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
    target.scrollIntoView();
  }

  function attach(svg) {
    const whole = [0, Number(svg.dataset.end)], picture = svg.querySelector(".window");
    const curves = [...picture.querySelectorAll("polyline")].map((line) => {
      const own = [...line.points].map((p) => [p.x, p.y]);
      const height = line.ownerSVGElement.viewBox.baseVal.height, most = Number(line.dataset.most);
      return {
        says: line.dataset.name, unit: line.dataset.unit,
        t_s: own.map(([x]) => x * whole[1] / 1000), value: own.map(([, y]) => most * (1 - y / height)),
      };
    });
    const own = [...picture.querySelectorAll(":scope > line, :scope > text")];
    const bottom = Number(svg.getAttribute("height")) - 20;
    const frame = document.createElement("div");
    frame.className = "lanesframe";
    frame.tabIndex = 0;
    frame.setAttribute("role", "group");
    frame.setAttribute("aria-label", `${svg.getAttribute("aria-label")}: ${help}`);
    svg.replaceWith(frame);
    frame.appendChild(svg);
    const tip = document.createElement("div");
    tip.className = "tip";
    tip.setAttribute("role", "status");
    tip.hidden = true;
    frame.appendChild(tip);
    const cursor = add("line", { y1: 0, y2: bottom, class: "cursor", visibility: "hidden" });
    let shown = whole, at_s = null, drag = null, band = null, scale = [];

    function add(name, attributes) {
      const made = document.createElementNS(svgNamespace, name);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
      svg.appendChild(made);
      return made;
    }
    const width = () => svg.getBoundingClientRect().width || 1;
    const timeAt = (event) => viewMath.valueAt((event.clientX - svg.getBoundingClientRect().left) / width(), shown);
    const placeOf = (t_s) => `${100 * viewMath.placeOf(t_s, shown)}%`;

    function draw() {
      const times = whole[1] / (shown[1] - shown[0]);
      picture.setAttribute("x", `${-100 * times * shown[0] / whole[1]}%`);
      picture.setAttribute("width", `${100 * times}%`);
      for (const made of scale) made.remove();
      scale = [];
      const isWhole = times < 1.001;
      for (const tick of own) tick.style.display = isWhole ? "" : "none";
      if (!isWhole) {
        const places = viewMath.ticks(...shown, width() / tickEvery_px);
        const step = places.length > 1 ? places[1] - places[0] : 1;
        scale = places.map((t) => {
          const made = add("text", { x: placeOf(t), y: bottom + 15, class: "time", "text-anchor": "middle" });
          made.textContent = `${viewMath.written(t, step)} s`;
          return made;
        });
      }
      tell();
    }

    function tell() {
      const visible = at_s !== null && at_s >= shown[0] && at_s <= shown[1];
      tip.hidden = !visible;
      cursor.setAttribute("visibility", visible ? "visible" : "hidden");
      if (!visible) return;
      cursor.setAttribute("x1", placeOf(at_s));
      cursor.setAttribute("x2", placeOf(at_s));
      const lines = curves.filter((c) => c.t_s.length && at_s >= c.t_s[0]).map((c) =>
        `${c.says}: ${viewMath.short(c.value[viewMath.lastBefore(c.t_s, at_s)])} ${c.unit}`);
      tip.replaceChildren(...[`${viewMath.seconds(at_s)} s`, ...lines].map((line) => Object.assign(document.createElement("span"), { textContent: line })));
      const x = width() * viewMath.placeOf(at_s, shown);
      const left = x + 14 + tip.offsetWidth > width() ? x - 14 - tip.offsetWidth : x + 14;
      tip.style.left = `${Math.max(0, left)}px`;
      tip.style.top = `${bottom + 18}px`;
    }

    const show = (next) => { shown = next; draw(); };
    const zoom = (at, factor) => show(viewMath.zoomed(shown, at, factor, whole, leastWindow_s));
    const middle = () => at_s ?? (shown[0] + shown[1]) / 2;

    frame.addEventListener("pointermove", (event) => {
      at_s = viewMath.clamp(timeAt(event), ...shown);
      if (drag !== null) {
        if (!band && Math.abs(event.clientX - drag.px) > dragFrom_px) band = add("rect", { y: 0, height: bottom, class: "band" });
        if (band) {
          const [a, b] = [drag.t_s, at_s].sort((x, y) => x - y);
          band.setAttribute("x", placeOf(a));
          band.setAttribute("width", `${100 * (b - a) / (shown[1] - shown[0])}%`);
        }
      }
      tell();
    });
    frame.addEventListener("pointerdown", (event) => { if (event.button === 0 && event.pointerType !== "touch") drag = { px: event.clientX, t_s: timeAt(event) }; });
    // A drag that ends on a mark is no click on it.
    frame.addEventListener("click", (event) => { if (frame.dataset.dragged) { event.preventDefault(); delete frame.dataset.dragged; } }, true);
    frame.addEventListener("dragstart", (event) => event.preventDefault());
    addEventListener("pointerup", () => {
      if (drag && band) {
        const times = [drag.t_s, at_s].sort((x, y) => x - y);
        frame.dataset.dragged = "yes";
        setTimeout(() => delete frame.dataset.dragged, 0);
        if (times[1] - times[0] >= leastWindow_s) show(times);
      }
      if (band) band.remove();
      drag = band = null;
    });
    frame.addEventListener("pointerleave", () => { if (!drag) { at_s = null; tell(); } });
    frame.addEventListener("dblclick", () => show(whole));
    frame.addEventListener("wheel", (event) => {
      // A page is scrolled past its pictures; with Ctrl the wheel looks closer.
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(timeAt(event), event.deltaY < 0 ? zoomStep : 1 / zoomStep);
    }, { passive: false });
    frame.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      const does = {
        "+": () => zoom(middle(), zoomStep), "=": () => zoom(middle(), zoomStep), "-": () => zoom(middle(), 1 / zoomStep),
        0: () => show(whole), Escape: () => { at_s = null; tell(); },
      }[event.key];
      if (event.ctrlKey || event.metaKey || event.altKey || !(by || does)) return;
      event.preventDefault();
      const length = shown[1] - shown[0];
      if (does) does();
      else if (event.shiftKey) show(viewMath.shifted(shown, by * moveShare * length, whole));
      else { at_s = viewMath.clamp(at_s === null ? shown[0] : at_s + by * stepShare * length, ...shown); tell(); }
    });
    new ResizeObserver(draw).observe(frame);
  }

  // Served pages have a page for each run: there a mark leads to its moment.
  function leadToRuns() {
    if (!location.protocol.startsWith("http")) return;
    for (const mark of document.querySelectorAll("svg.timeline a[data-t]")) {
      const key = mark.getAttribute("href").match(/^#t-(\w+)$/);
      if (key) mark.setAttribute("href", `../runs/${key[1]}/#t=${mark.dataset.t}`);
    }
  }

  document.documentElement.classList.add("scripted");
  const attachAll = () => document.querySelectorAll("svg.timeline").forEach((svg) => { if (!svg.closest(".lanesframe")) attach(svg); });
  attachAll();
  document.addEventListener("renewed", attachAll);
  leadToRuns();
  addEventListener("hashchange", unfold);
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
  unfold();
})();
