// The native simulator and its policies, on the server that the page comes from: in place of the page's own.

// Return the JSON of a policy, as in "sac/30"; an error says why there is none.
export async function json(name) {
  const answer = await fetch(`policies/${name}.json`);
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

// Return what simulates, to be used like the worker, whose messages it understands (`worker.js`).
export function simulator() {
  return new Native();
}

class Native {
  constructor() {
    this.socket = new WebSocket(new URL("live", location.href).href.replace(/^http/, "ws"));
    this.opened = new Promise((resolve) => (this.socket.onopen = resolve));
    this.socket.onmessage = ({ data }) => {
      const message = JSON.parse(data);
      this.failed ||= message.kind === "failure";
      this.onmessage({ data: message });
    };
    this.socket.onclose = () => {
      if (!this.failed) this.onerror({ message: "make watch, which simulates, has ended" });
    };
  }

  // Send a message, with its policy's name in place of the policy: the server has those. Moments of links
  // are left out: their episodes begin anew.
  async postMessage({ policy, moment, ...message }) {
    await this.opened;
    const named = policy && { agent: policy.agent, seed: policy.seed };
    if (this.socket.readyState !== WebSocket.OPEN) return;
    this.socket.send(JSON.stringify({ ...message, policy: named }, plain));
  }
}

function plain(key, value) {
  return ArrayBuffer.isView(value) ? [...value] : value;
}
