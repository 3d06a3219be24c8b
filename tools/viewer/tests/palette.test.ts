// SPDX-License-Identifier: BSD-2-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { colorAt, paletteBytes } from "../src/palette";

test("palettes grow lighter all the way, so that they can be read without colours", () => {
  for (const name of ["viridis", "cividis"] as const) {
    let before = -1;
    for (let i = 0; i <= 20; ++i) {
      const [r, g, b] = colorAt(name, i / 20);
      const light = 0.2126 * r + 0.7152 * g + 0.0722 * b;
      assert.ok(light > before, `${name} at ${i / 20}`);
      before = light;
    }
    assert.equal(paletteBytes(name).length, 1024);
  }
});
