// The visitor against the metronome: two keys, a round of some seconds, and the best learner beside.


export class Game {
  // `page` starts rounds and drives robots; `elements` are the game's.
  constructor(page, elements) {
    Object.assign(this, { page, elements, left: 0, seconds: 20 });
    const { content } = page;
    const byReturn = (names) => [...names].sort((one, other) => mean(content, other) - mean(content, one));
    const names = Object.keys(content.agents);
    const rhythms = names.filter((name) => page.kind(name) === "cycle" && content.agents[name].robot === page.robot);
    [this.metronome] = byReturn(rhythms);
    [this.rival] = byReturn(names.filter((name) => content.agents[name].learns && content.agents[name].robot === page.robot));
    elements.section.hidden = !this.metronome || !this.rival;
    if (elements.section.hidden) return;
    elements.rival.textContent = content.agents[this.rival].label;
    elements.start.onclick = () => this.begin();
    elements.beats.forEach((own, i) => (own.onpointerdown = own.onclick = () => this.beat(i)));
  }

  get running() {
    return this.left > 0;
  }

  async begin() {
    const { page, elements } = this;
    const seed = page.content.agents[this.rival].seeds[0].seed;
    this.beats = await page.rhythm(this.metronome);
    this.steps = Math.round(this.seconds / page.dt);
    this.left = this.steps;
    elements.result.textContent = `Tap F and J, or the two buttons. ${this.seconds} s from now on.`;
    await page.choose({ a: { agent: "you", seed: null, start: 0 }, b: { agent: this.rival, seed, start: 0 } });
    page.drive(this.beats[0].map(() => 0));
    page.run(true, 1);
    elements.beats[0].focus();
  }

  beat(which) {
    if (!this.running) return;
    this.page.drive(this.beats[which]);
    this.elements.beats.forEach((own, i) => own.setAttribute("aria-pressed", i === which));
  }

  // Follow a round; `totals` are the returns of both robots, `ended` whether the visitor's has fallen.
  follow(steps, totals, ended) {
    if (!this.running || totals.length < 2) return;
    this.left = Math.max(0, this.steps - steps);
    if (ended) this.left = 0;
    const seconds = (this.left * this.page.dt).toFixed(0);
    this.elements.score.textContent = `you ${totals[0].toFixed(0)}, ${this.elements.rival.textContent} ${totals[1].toFixed(0)}, ${seconds} s left`;
    if (!this.left) this.finish(totals);
  }

  async finish([yours, rivals]) {
    const { page, elements } = this;
    page.run(false, 1);
    const own = page.content.agents[this.metronome];
    const score = await page.outrun(this.metronome, page.startOf("b"), this.steps);
    const won = yours > score ? "You beat the metronome" : "The metronome wins";
    elements.result.textContent =
      `${won}: you ${yours.toFixed(0)}, ${own.label} ${score.toFixed(0)}, ${elements.rival.textContent} ${rivals.toFixed(0)}.`;
    elements.start.focus();
  }
}

function mean(content, name) {
  const { starts } = content.agents[name].seeds[0];
  return starts.reduce((sum, own) => sum + own.return, 0) / starts.length;
}
