// The page's end of what simulates: a worker, or what is used like one.

export class Physics {
  // `listeners` get the worker's messages by their kind.
  constructor(worker, listeners) {
    this.waiting = [];
    this.worker = worker;
    const own = {
      answer: ({ answer }) => this.waiting.shift().resolve(answer),
      failure: ({ text }) => {
        this.waiting.shift()?.reject(new Error(text));
        listeners.failure(text);
      },
    };
    const all = { ...listeners, ...own };
    this.worker.onmessage = ({ data }) => all[data.kind](data);
    this.worker.onerror = (event) => listeners.failure(event.message ?? "the worker does not start");
  }

  tell(kind, message = {}) {
    this.worker.postMessage({ kind, ...message });
  }

  // Ask for something; answers come in the order of the questions.
  ask(kind, message = {}) {
    return new Promise((resolve, reject) => {
      this.waiting.push({ resolve, reject });
      this.tell(kind, message);
    });
  }
}
