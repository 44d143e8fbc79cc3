// Running plots of the last seconds: torso height, reward terms, torques and contacts of each robot.

const SECONDS = 10; // shown
const LEFT = 46, ROW = 74, GAP = 26; // [pixels]
const INK = "#333", FAINT = "#ccd2d9";
const DASHES = [[], [6, 4], [2, 3], [8, 3, 2, 3]];

export class Plots {
  // Draws on a canvas whose height it sets.
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.histories = [[], []];
    this.robots = [null, null];
  }

  // Show a robot in a slot: `robot` has its label, colour and motors; null empties the slot.
  place(slot, robot) {
    this.robots[slot] = robot;
    this.histories[slot] = [];
  }

  add(slot, reports) {
    const own = this.histories[slot];
    for (const report of reports) {
      if (own.length && report.time <= own.at(-1).time) own.length = 0; // a new episode
      own.push(report);
    }
    while (own.length && own[0].time < own.at(-1).time - SECONDS) own.shift();
  }

  draw() {
    const { canvas, context } = this;
    const shown = [0, 1].filter((slot) => this.robots[slot] && this.histories[slot].length);
    const rows = this.rows(shown);
    const width = canvas.clientWidth, height = rows.length * (ROW + GAP);
    const ratio = devicePixelRatio;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      canvas.style.height = `${height}px`;
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const end = Math.max(SECONDS, ...shown.map((slot) => this.histories[slot].at(-1).time));
    rows.forEach((row, i) => this.row(row, i * (ROW + GAP) + GAP - 6, width, end));
  }

  rows(shown) {
    const lines = (value, dash) => shown.map((slot) => ({ slot, value, dash }));
    const terms = [...new Set(shown.flatMap((slot) => Object.keys(this.histories[slot].at(-1).terms)))];
    return [
      { title: "Torso height [m]", low: 0, lines: lines((own) => own.height) },
      {
        title: `Reward per control step: ${terms.map((own) => own.replaceAll("_", " ")).join(", ")}`,
        low: 0,
        lines: terms.flatMap((term, i) => lines((own) => own.terms[term] ?? 0, DASHES[i % DASHES.length])),
      },
      ...shown.map((slot) => ({
        title: `Torques over peak torques, ${this.robots[slot].label}`,
        strips: this.robots[slot].motors,
        slot,
      })),
      { title: "Contacts", low: 0, whole: true, lines: lines((own) => own.contacts) },
    ];
  }

  row({ title, lines, strips, slot, low, whole }, top, width, end) {
    const { context } = this;
    const x = (time) => LEFT + ((time - end + SECONDS) / SECONDS) * (width - LEFT - 8);
    context.fillStyle = INK;
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(title, LEFT, top - 4, width - LEFT);
    context.strokeStyle = FAINT;
    context.setLineDash([]);
    context.lineWidth = 1;
    context.strokeRect(LEFT, top, width - LEFT - 8, ROW - 8);
    if (strips) {
      this.strips(strips, slot, top, x);
      return;
    }
    const values = lines.flatMap(({ slot: own, value }) => this.histories[own].map(value));
    const least = Math.min(low, ...values), most = Math.max(1, ...values);
    const y = (value) => top + (ROW - 8) * (1 - (value - least) / (most - least));
    context.textAlign = "right";
    for (const value of [least, most]) context.fillText(format(value), LEFT - 5, y(value) + (value === most ? 9 : 0));
    context.lineWidth = 1.6;
    for (const { slot: own, value, dash = [] } of lines) {
      context.strokeStyle = this.robots[own].colour;
      context.setLineDash(dash);
      context.beginPath();
      let before = null;
      for (const report of this.histories[own]) {
        if (whole && before !== null) context.lineTo(x(report.time), y(before));
        before = value(report);
        context.lineTo(x(report.time), y(before));
      }
      context.stroke();
    }
  }

  // Draw a strip for each motor: blue pushes one way, orange the other.
  strips(motors, slot, top, x) {
    const { context } = this;
    const history = this.histories[slot], height = (ROW - 8) / motors.length;
    history.forEach((report, i) => {
      if (i === 0) return;
      const from = x(history[i - 1].time), to = x(report.time);
      report.torques.forEach((torque, motor) => {
        context.fillStyle = torque < 0 ? `rgba(0, 114, 178, ${-torque})` : `rgba(213, 94, 0, ${torque})`;
        context.fillRect(from, top + motor * height, to - from + 0.5, height);
      });
    });
    context.fillStyle = INK;
    context.font = "9px system-ui, sans-serif";
    context.textAlign = "right";
    if (height < 8) {
      context.fillText("motor 1", LEFT - 4, top + 8);
      context.fillText(`motor ${motors.length}`, LEFT - 4, top + ROW - 9);
    } else motors.forEach((name, i) => context.fillText(name.slice(0, 9), LEFT - 4, top + (i + 0.5) * height + 3));
  }
}

function format(value) {
  return Math.abs(value) >= 100 ? value.toFixed(0) : String(Number(value.toFixed(1)));
}
