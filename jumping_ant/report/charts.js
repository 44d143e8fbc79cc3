"use strict";

// Each chart is drawn into the element whose id is its name, when it comes near the window: a page
// of many agents has a hundred charts, and those in closed parts have no width yet.
const charts = JSON.parse(document.getElementById("data").textContent);
const config = { responsive: true, displayModeBar: false };
const undrawn = new Set(Object.keys(charts).map((name) => document.getElementById(name)));

function draw(element) {
  const { data, layout } = charts[element.id];
  undrawn.delete(element);
  nearness.unobserve(element);
  Plotly.newPlot(element, data, layout, config);
}

const nearness = new IntersectionObserver(
  (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
  { rootMargin: "600px" },
);
for (const element of undrawn) {
  element.style.height = `${charts[element.id].layout.height}px`;
  nearness.observe(element);
}
addEventListener("beforeprint", () => [...undrawn].filter((one) => one.checkVisibility()).forEach(draw));
