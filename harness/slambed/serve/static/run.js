// SPDX-License-Identifier: Apache-2.0
// One run: a slider over its frames moves image, path, timeline and numbers together.
"use strict";

(async () => {
  const player = document.getElementById("player");
  const by = (id) => document.getElementById(id);
  const answer = await fetch(player.dataset.run);
  if (!answer.ok) {
    by("story").insertAdjacentHTML("beforebegin", '<p class="warn">The data of this run could not be had.</p>');
    return;
  }
  const run = await answer.json();
  const { frames } = run;
  const count = frames.t_s.length;
  player.hidden = false;
  if (by("still")) by("still").hidden = true;
  by("cut").hidden = run.frames_left_out === 0;
  by("cut").textContent = `The slider ends with frame ${count}; the ${run.frames_left_out} frames after it are left out.`;

  let frame = 0, loading = false, wanted = null;
  const picture = by("picture"), slider = by("cursor");
  slider.max = Math.max(0, count - 1);
  slider.disabled = by("play").disabled = count === 0;
  picture.hidden = !run.has_pictures;
  const overlay = featuresOf(by("features"), by("show-features"));
  by("show-features").disabled = !(run.has_pictures && run.has_features);
  by("show-map").disabled = run.map.t_s.length === 0;

  // Loads one image at a time, the newest one requested, so that the browser does not fall behind.
  function askForPicture(index) {
    if (!run.has_pictures || index === null) return;
    if (loading) { wanted = index; return; }
    loading = true;
    picture.src = `frames/${index}.jpg`;
    if (!by("show-features").disabled) overlay.at(index);
  }
  function pictureEnded() {
    loading = false;
    if (wanted !== null) { const next = wanted; wanted = null; askForPicture(next); }
  }
  picture.addEventListener("load", pictureEnded);
  picture.addEventListener("error", pictureEnded);

  const valueOf = (curve, t_s) => curve.value[viewMath.lastBefore(curve.t_s, t_s)];

  // Shows the values at the end of the frame, because a loss is reported only then.
  function tell(t_s) {
    const done_s = Math.max(t_s, frames.done_s[frame] ?? t_s);
    const state = frames.state[frame].replace("_", " ");
    const facts = [`${state}`];
    if (frames.track_ms[frame] !== null) facts.push(`tracking ${viewMath.short(frames.track_ms[frame])} ms`);
    if (frames.inliers[frame] !== null) facts.push(`${frames.inliers[frame]} inliers`);
    for (const curve of run.series) {
      if (curve.lane === "tracking" || curve.lane === "throttled" || !(curve.t_s[0] <= done_s)) continue;
      facts.push(`${curve.lane} ${curve.name}: ${viewMath.short(valueOf(curve, done_s))} ${curve.unit}`);
    }
    const last = viewMath.lastBefore(run.marks.map((mark) => mark.t_s), done_s);
    if (last >= 0 && run.marks[last].t_s <= done_s) facts.push(`last: ${run.marks[last].says} at ${viewMath.seconds(run.marks[last].t_s)} s`);
    by("values").textContent = facts.join("; ");
    by("picture-says").textContent = frames.index[frame] === null ? "" : `Frame ${frames.index[frame]} of the sequence, ${state}`;
    picture.alt = by("picture-says").textContent;
    const of = `${frame + 1} of ${count}`;
    by("now").textContent = `${viewMath.seconds(t_s)} s, frame ${of}`;
    slider.setAttribute("aria-valuetext", `${viewMath.seconds(t_s)} seconds, frame ${of}, ${state}`);
  }

  const space = spaceOf(by("space"), run.path, run.map, ({ error_m, keyframes, points }) => {
    const apart = error_m === null ? "" : ` Now ${viewMath.short(100 * error_m)} cm apart.`;
    const seen = points ? `, and ${points} points that they see` : "";
    const map = keyframes ? ` Squares: ${keyframes} keyframe${keyframes > 1 ? "s" : ""}${seen}.` : "";
    by("space-says").textContent = `Blue: estimate (${run.path.how}); gray: truth.${apart}${map}`;
  });
  by("show-map").addEventListener("change", () => space.showMap(by("show-map").checked));
  const lanes = lanesOf(by("lanes"), run, (t_s) => { stop(); go(viewMath.lastBefore(frames.t_s, t_s)); });

  function go(next) {
    if (!count) return;
    frame = viewMath.clamp(next, 0, count - 1);
    slider.value = frame;
    const t_s = frames.t_s[frame], seq_s = frames.seq_s[frame] ?? t_s;
    askForPicture(frames.index[frame]);
    tell(t_s);
    lanes.at(t_s);
    space.at(seq_s);
  }

  let playing = 0;
  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    by("play").textContent = "Play";
    by("play").setAttribute("aria-pressed", "false");
  }
  function play() {
    if (frame >= count - 1) go(0);
    const begin_ms = performance.now(), from_s = frames.t_s[frame];
    by("play").textContent = "Pause";
    by("play").setAttribute("aria-pressed", "true");
    const step = (now_ms) => {
      const next = viewMath.lastBefore(frames.t_s, from_s + (now_ms - begin_ms) / 1000);
      if (next > frame) go(next);
      if (frame >= count - 1) { stop(); return; }
      playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }
  by("play").addEventListener("click", () => (playing ? stop() : play()));
  slider.addEventListener("input", () => { stop(); go(Number(slider.value)); });
  // A mark of a report leads to its moment.
  function goToMoment() {
    const asked = location.hash.match(/^#t=([\d.]+)$/);
    if (!asked) return false;
    stop();
    go(viewMath.lastBefore(frames.t_s, Number(asked[1])));
    return true;
  }
  addEventListener("hashchange", goToMoment);
  if (!goToMoment()) go(0);
  player.dataset.ready = "yes";
})();
