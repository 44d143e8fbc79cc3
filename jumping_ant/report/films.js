"use strict";

draw(document.getElementById("heights")); // it shows the films' time

// Films in the window play together: dozens at once would stutter. The longest of them that is ready
// sets the time, shorter ones hold their last frame until all restart, and the chart of heights shows
// the time.
const videos = [...document.querySelectorAll(".films video")];
const play = document.getElementById("play");
const slider = document.getElementById("time");
const clock = document.getElementById("clock");
const speed = document.getElementById("speed");
const TOLERANCE = 0.06; // [s] that films may drift apart
const CURSOR_PERIOD = 100; // [ms] between moves of the chart's cursor
let isPlaying = false;
let time = 0; // [s] in the films
let nextFrame = 0;
let lastMove = 0;

// A film that is missing or not loaded yet has no duration.
const ready = () => videos.filter((video) => video.duration > 0 && !video.error);
const inWindow = new Set();
const seen = () => ready().filter((video) => inWindow.has(video));
const longest = (films) => films.sort((one, other) => other.duration - one.duration)[0];

function show() {
  const text = `${time.toFixed(1)} s`;
  slider.max = longest(ready())?.duration ?? 1;
  slider.value = time;
  slider.setAttribute("aria-valuetext", text);
  clock.textContent = text;
  const now = performance.now();
  if (now - lastMove < CURSOR_PERIOD && isPlaying) return;
  lastMove = now;
  const line = { type: "line", x0: time, x1: time, y0: 0, y1: 1, yref: "paper", line: { color: "#22262e", width: 1.5 } };
  Plotly.relayout("heights", { shapes: [line] });
}

function moveTo(seconds, tolerance = 0) {
  time = seconds;
  for (const video of seen()) {
    const place = Math.min(time, video.duration);
    if (Math.abs(video.currentTime - place) > tolerance) video.currentTime = place;
    if (isPlaying && video.paused && place < video.duration) video.play().catch(stopIfForbidden);
  }
  show();
}

function follow() {
  const film = longest(seen());
  if (film) moveTo(film.ended ? 0 : film.currentTime, TOLERANCE);
  nextFrame = requestAnimationFrame(follow);
}

function setPlaying(wanted) {
  isPlaying = wanted;
  play.textContent = isPlaying ? "Pause" : "Play";
  cancelAnimationFrame(nextFrame);
  if (isPlaying) {
    nextFrame = requestAnimationFrame(follow);
  } else {
    for (const video of videos) video.pause();
    moveTo(time);
  }
}

// A browser may block autoplay; a film that is paused early does no harm.
function stopIfForbidden(error) {
  if (error.name === "NotAllowedError") setPlaying(false);
}

play.addEventListener("click", () => setPlaying(!isPlaying));
slider.addEventListener("input", () => moveTo(Number(slider.value)));
speed.addEventListener("change", () => {
  for (const video of videos) video.playbackRate = Number(speed.value);
});
for (const video of videos) video.addEventListener("loadedmetadata", () => moveTo(time, TOLERANCE));
const sight = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (isIntersecting) inWindow.add(target);
    else inWindow.delete(target);
    if (!isIntersecting) target.pause();
  }
  moveTo(time, TOLERANCE);
});
for (const video of videos) sight.observe(video);
document.getElementById("heights").on("plotly_click", (event) => moveTo(event.points[0].x));
setPlaying(!matchMedia("(prefers-reduced-motion: reduce)").matches);
