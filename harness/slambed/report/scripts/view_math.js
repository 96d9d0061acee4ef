// SPDX-License-Identifier: Apache-2.0
// What figures, time line and path compute, without a browser: the tests run it without one, too.
"use strict";

const viewMath = (() => {
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  // A window [begin, end] made 1 / factor as long around `at`, inside [low, high], not shorter than `least`.
  function zoomed([begin, end], at, factor, [low, high], least) {
    const length = clamp((end - begin) / factor, least, high - low);
    const share = end > begin ? clamp((at - begin) / (end - begin), 0, 1) : 0.5;
    return shifted([at - share * length, at - share * length + length], 0, [low, high]);
  }

  // A window moved by `by`, as far as there is something.
  function shifted([begin, end], by, [low, high]) {
    const length = Math.min(end - begin, high - low);
    const first = clamp(begin + by, low, high - length);
    return [first, first + length];
  }

  // Round places of an axis from low to high, about `count` of them.
  function ticks(low, high, count) {
    const span = high - low;
    if (!(span > 0) || !(count > 0)) return [];
    const rough = span / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * span; i++) found.push(i * step);
    return found;
  }

  // A tick as it is written: as many digits as the step between two needs.
  function written(value, step) {
    const digits = clamp(-Math.floor(Math.log10(Math.abs(step) || 1) + 1e-9), 0, 9);
    return (Math.abs(value) < Math.abs(step) * 1e-6 ? 0 : value).toFixed(digits);
  }

  // A number for people: four digits that count.
  const short = (value) => (Number.isFinite(value) ? String(Number(value.toPrecision(4))) : "-");

  // A time for people; what is a hair before 0 is 0.
  const seconds = (value) => value.toFixed(2).replace(/^-(0\.00)$/, "$1");

  // Index of the last of some rising times that is not after t; 0 before the first, -1 of none.
  function lastBefore(times, t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle + 1; else high = middle;
    }
    return times.length ? Math.max(0, low - 1) : -1;
  }

  // Index of the point nearest to (x, y) among xs and ys, -1 where none is within `reach`.
  function nearest(xs, ys, x, y, reach) {
    let best = -1, least = reach * reach;
    for (let i = 0; i < xs.length; i++) {
      const distance = (xs[i] - x) ** 2 + (ys[i] - y) ** 2;
      if (distance <= least) { least = distance; best = i; }
    }
    return best;
  }

  // A point in space as seen by an eye turned by `yaw` round the upright axis and raised by `pitch`
  // (radians), far away: [right, up, towards the eye]. Camera worlds differ; z is up here.
  function seen([x, y, z], yaw, pitch) {
    const right = Math.cos(yaw) * x + Math.sin(yaw) * y;
    const away = -Math.sin(yaw) * x + Math.cos(yaw) * y;
    return [right, Math.cos(pitch) * z + Math.sin(pitch) * away, Math.sin(pitch) * z - Math.cos(pitch) * away];
  }

  // The middle and the radius of a ball around all points.
  function ballAround(points) {
    if (!points.length) return { middle: [0, 0, 0], radius: 1 };
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const point of points) {
      for (let i = 0; i < 3; i++) { low[i] = Math.min(low[i], point[i]); high[i] = Math.max(high[i], point[i]); }
    }
    const middle = low.map((value, i) => (value + high[i]) / 2);
    const radius = Math.hypot(...low.map((value, i) => (high[i] - value) / 2));
    return { middle, radius: radius || 1 };
  }

  // Where along an axis a value is: 0 at its begin, 1 at its end.
  function placeOf(value, [begin, end], scale) {
    const f = scale === "log" ? Math.log10 : (v) => v;
    return (f(value) - f(begin)) / (f(end) - f(begin));
  }

  // The value at a place of an axis: the other way round.
  function valueAt(place, [begin, end], scale) {
    if (scale !== "log") return begin + place * (end - begin);
    return 10 ** (Math.log10(begin) + place * (Math.log10(end) - Math.log10(begin)));
  }

  return { clamp, zoomed, shifted, ticks, written, short, seconds, lastBefore, nearest, seen, ballAround, placeOf, valueAt };
})();
