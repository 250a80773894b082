"use strict";
(() => {
  const at = id => document.getElementById(id);
  const scene = JSON.parse(at("data").textContent);
  const last = scene.time.length - 1, step = last > 0 ? scene.time[1] - scene.time[0] : 0.02;
  const now = (values, k) => Array.isArray(values) ? values[k] : values;
  const parts = Object.entries(scene.moves).map(([id, move]) => [at(id), move]);
  const svg = "http://www.w3.org/2000/svg";

  const dials = scene.dials.map(dial => {
    const row = document.createElement("div"), bar = document.createElementNS(svg, "svg");
    const fill = document.createElementNS(svg, "rect"), value = document.createElement("span");
    const label = document.createElement("span");
    row.className = "dial";
    label.textContent = dial.label;
    bar.setAttribute("viewBox", "0 0 100 4");
    bar.setAttribute("preserveAspectRatio", "none");
    fill.setAttribute("height", "4");
    fill.setAttribute("fill", dial.color);
    bar.append(fill);
    row.append(label, bar, value);
    at("dials").append(row);
    return k => {
      const share = Math.min(Math.max(dial.values[k] / dial.full, 0), 1);
      fill.setAttribute("width", String(100 * share));
      value.textContent = `${dial.values[k].toFixed(dial.full < 5 ? 2 : 1)} ${dial.unit}`;
    };
  });

  let shown = -1;
  function draw(k) {
    if (k === shown) return;
    shown = k;
    for (const [part, move] of parts) {
      const turn = now(move.turn, k) * 180 / Math.PI;
      part.setAttribute("transform", `translate(${now(move.x, k)} ${now(move.y, k)}) ` +
        `rotate(${turn}) scale(${now(move.stretch, k)} 1)`);
    }
    dials.forEach(dial => dial(k));
    at("frame").value = String(k);
    at("time").textContent = `${scene.time[k].toFixed(2)} s`;
  }

  let playing = false, place = 0, before = null;
  function follow(instant) {
    if (!playing) return;
    if (before !== null) place += (instant - before) / 1000 / step * Number(at("speed").value);
    before = instant;
    draw(Math.min(Math.floor(place), last));
    if (place >= last) return stop();
    requestAnimationFrame(follow);
  }
  function stop() { playing = false; before = null; at("play").textContent = "play"; }
  function play() {
    if (place >= last) place = 0;
    playing = true;
    at("play").textContent = "pause";
    requestAnimationFrame(follow);
  }
  at("play").addEventListener("click", () => playing ? stop() : play());
  at("frame").addEventListener("input", () => { stop(); place = Number(at("frame").value); draw(place); });
  draw(0);
})();
