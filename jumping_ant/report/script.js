"use strict";

// Charts: each is drawn into the element that bears its name.
const charts = JSON.parse(document.getElementById("data").textContent);
const config = { responsive: true, displayModeBar: false };
for (const [name, chart] of Object.entries(charts)) {
  Plotly.newPlot(name, chart.data, chart.layout, config);
}

// Films: they play together, the first that can gives the time, and the chart of heights shows it.
const videos = [...document.querySelectorAll("video")];
const play = document.getElementById("play");
const slider = document.getElementById("time");
const clock = document.getElementById("clock");
const speed = document.getElementById("speed");
const TOLERANCE = 0.06; // [s] that films may be apart
const CURSOR_PERIOD = 100; // [ms] between moves of the chart's cursor
let lastMove = 0;

const duration = () => Math.min(...videos.map((video) => video.duration || Infinity));
const isPlaying = () => !videos[0].paused;

function show(time) {
  const end = duration();
  if (!Number.isFinite(end)) return;
  slider.max = end;
  slider.value = time;
  clock.textContent = `${time.toFixed(1)} s`;
  const now = performance.now();
  if (now - lastMove < CURSOR_PERIOD && isPlaying()) return;
  lastMove = now;
  const line = { type: "line", x0: time, x1: time, y0: 0, y1: 1, yref: "paper", line: { color: "#22262e", width: 1.5 } };
  Plotly.relayout("heights", { shapes: [line] });
}

function seek(time) {
  for (const video of videos) video.currentTime = time;
  show(time);
}

function follow() {
  if (!isPlaying()) return;
  const time = videos[0].currentTime;
  for (const video of videos.slice(1)) {
    if (Math.abs(video.currentTime - time) > TOLERANCE) video.currentTime = time;
  }
  show(time);
  requestAnimationFrame(follow);
}

async function toggle() {
  if (isPlaying()) {
    for (const video of videos) video.pause();
  } else {
    await Promise.allSettled(videos.map((video) => video.play()));
    requestAnimationFrame(follow);
  }
  play.textContent = isPlaying() ? "Pause" : "Play";
}

play.addEventListener("click", toggle);
slider.addEventListener("input", () => seek(Number(slider.value)));
speed.addEventListener("change", () => {
  for (const video of videos) video.playbackRate = Number(speed.value);
});
videos[0]?.addEventListener("loadedmetadata", () => show(videos[0].currentTime));
if (!matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
document.getElementById("heights").on("plotly_click", (event) => seek(event.points[0].x));
