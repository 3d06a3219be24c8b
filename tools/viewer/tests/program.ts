// SPDX-License-Identifier: BSD-2-Clause
// Starts programs that tell an address.
import { type ChildProcess, spawn } from "node:child_process";

const children: ChildProcess[] = [];

export interface Started {
  child: ChildProcess;
  url: string;
  /** All that it has told. */
  text: () => string;
  ended: Promise<number | null>;
}

/** Starts a program and waits for the address that it tells. */
export async function start(program: string, words: string[]): Promise<Started> {
  const child = spawn(program, words, { stdio: ["pipe", "pipe", "pipe"] });
  children.push(child);
  let text = "";
  const ended = new Promise<number | null>((done) => child.on("close", done));
  const url = await new Promise<string>((done, fail) => {
    const take = (bytes: Buffer): void => {
      text += bytes.toString();
      const found = /http:\/\/\S+\//.exec(text);
      if (found) done(found[0]);
    };
    child.stdout.on("data", take);
    child.stderr.on("data", take);
    child.on("close", () => fail(new Error(`no address: ${text}`)));
  });
  return { child, url, text: () => text, ended };
}

/** Whatever is still there. */
export function killAll(): void {
  for (const child of children) child.kill("SIGKILL");
}
