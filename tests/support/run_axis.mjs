// Runs the core as WebAssembly: `node run_axis.mjs AXIS.wasm RUNS.json OUT`. Writes the log of every run, one after the
// other, as doubles in the order of bytes of this computer.
import { readFileSync, writeFileSync } from "node:fs";
import { Core } from "../../hmi/src/gains/core.ts";

const [, , wasm, runs, out] = process.argv;
const core = await Core.load(readFileSync(wasm));
const logs = [];
for (const { numbers, stands_rad, plans } of JSON.parse(
  readFileSync(runs, "utf-8"),
)) {
  core.stand(numbers, stands_rad);
  for (const { plan, scans } of plans) {
    const log = core.run(plan, scans);
    for (const name of core.columns)
      logs.push(Buffer.from(log.get(name).buffer));
  }
}
writeFileSync(out, Buffer.concat(logs));
