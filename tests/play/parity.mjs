// Run the page's modules in node: a request of JSON on standard input, the answer on standard output.
//
// Usage: node tests/play/parity.mjs MUJOCO < REQUEST
// MUJOCO is a folder with mujoco.js and mujoco.wasm. A request has the page's content and tasks, each a
// policy with a reference to verify it by, or with starts to play from.

import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

import { returns, verify } from "../../jumping_ant/play/verification.js";

const folder = pathToFileURL(`${process.argv[2]}/`);
const { default: loadMujoco } = await import(new URL("mujoco.mjs", folder));
const mujoco = await loadMujoco({ wasmBinary: readFileSync(new URL("mujoco.wasm", folder)) });
const { content, tasks } = JSON.parse(readFileSync(0, "utf8"));
const answers = tasks.map((task) => (task.reference ? verify : returns)(mujoco, content, task));
process.stdout.write(JSON.stringify(answers));
