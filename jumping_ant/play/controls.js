// The page's controls: which robots, which perturbations; ordinary elements that keyboards and screen
// readers know.

const NONE = "", YOU = "you";

export const element = (id) => document.getElementById(id);

function option(value, text) {
  return Object.assign(document.createElement("option"), { value, textContent: text });
}

// The choice of a robot for a slot: its agent, its seed and its start.
export class Chooser {
  // `name` is "a" or "b"; `changed` gets the choice, or null for no robot.
  constructor(name, content, changed) {
    this.content = content;
    this.selects = ["agent", "seed", "start"].map((part) => element(`${part}-${name}`));
    const [agent, seed] = this.selects;
    if (name === "b") agent.append(option(NONE, "none"));
    for (const [key, { label }] of Object.entries(content.agents)) agent.append(option(key, label));
    agent.append(option(YOU, "you, with keys 1 to " + content.task.commands.length));
    agent.onchange = () => {
      this.fill(agent.value, null);
      changed(this.chosen);
    };
    seed.onchange = () => changed(this.chosen);
    this.selects[2].onchange = () => changed(this.chosen);
  }

  get chosen() {
    const [agent, seed, start] = this.selects.map((own) => own.value);
    if (agent === NONE) return null;
    return { agent, seed: agent === YOU ? null : Number(seed), start: Number(start) };
  }

  show(chosen) {
    const [agent, , start] = this.selects;
    agent.value = chosen?.agent ?? NONE;
    this.fill(agent.value, chosen?.seed);
    start.value = chosen?.start ?? 0;
  }

  fill(agent, chosen) {
    const [, seed, start] = this.selects;
    const seeds = this.content.agents[agent]?.seeds ?? [];
    seed.replaceChildren(...seeds.map((own, i) => option(own.seed, i ? own.seed : `${own.seed} (best in validation)`)));
    seed.value = chosen ?? seeds[0]?.seed ?? "";
    seed.disabled = !seeds.length;
    const count = seeds[0]?.starts.length ?? 1;
    const before = start.value;
    start.replaceChildren(...Array.from({ length: count }, (_, i) => option(i, `held-out ${i + 1}`)));
    start.value = before < count ? before || 0 : 0;
    start.disabled = agent === NONE;
  }
}

// The sliders of all perturbations.
export class Sliders {
  // `changed` gets the levels that are not as usual, by name.
  constructor(place, sliders, changed) {
    this.rows = sliders.map((slider) => {
      const row = document.createElement("div");
      row.className = "slider";
      const id = `slider-${slider.name}`;
      row.innerHTML = `<label></label><output></output><div class="track"><input type="range"></div>`;
      const [label, output, track] = row.children;
      const input = track.firstElementChild;
      Object.assign(input, { id, min: slider.low, max: slider.high, step: slider.step > 0.5 ? slider.step : "any" });
      input.dataset.step = slider.step;
      label.htmlFor = id;
      label.textContent = slider.label;
      input.title = slider.about;
      const own = { slider, input, output };
      input.oninput = () => {
        this.tell(own);
        changed(this.levels);
      };
      input.onkeydown = (event) => this.key(own, event);
      place.append(row);
      return own;
    });
    this.show({});
  }

  get levels() {
    const own = this.rows.filter(({ slider, input }) => Math.abs(input.value - slider.usual) > slider.step / 1000);
    return Object.fromEntries(own.map(({ slider, input }) => [slider.name, Number(input.value)]));
  }

  show(levels) {
    for (const row of this.rows) {
      row.input.value = levels[row.slider.name] ?? row.slider.usual;
      this.tell(row);
    }
  }

  // Move by a hundredth of the range: an input of any step would move by 1.
  key({ slider, input }, event) {
    const up = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!up) return;
    event.preventDefault();
    input.value = Number(input.value) + up * slider.step;
    input.oninput();
  }

  tell({ slider, input, output }) {
    const text = `${Number(Number(input.value).toPrecision(3))} ${slider.unit}`.trim();
    output.textContent = text;
    input.setAttribute("aria-valuetext", text);
  }
}

// Buttons of the commands, one of which is always pressed.
export class Commands {
  // `chosen` gets a command's number.
  constructor(place, commands, chosen) {
    this.buttons = commands.map((_, i) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: i + 1 });
      button.title = i ? `command ${i}` : "command 0: no torque";
      button.setAttribute("aria-label", button.title);
      button.onclick = () => chosen(i);
      place.append(button);
      return button;
    });
    this.show(0);
  }

  show(command) {
    this.buttons.forEach((own, i) => own.setAttribute("aria-pressed", i === command));
  }
}
