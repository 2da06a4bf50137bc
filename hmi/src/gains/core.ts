/** The core as WebAssembly (`core/web/axis.cpp`): one axis under the position law, the bits that the Python module has. */

/** Numbers of an axis by name, as `tools/build_wasm.py` writes them. */
export type Numbers = Record<string, number | number[]>;

/** A set-point plan; segments of constant jerk: time at the start, angle, speed, acceleration, jerk, one after the other. */
export interface Plan {
  segments: number[];
  duration_s: number;
  pos_end_rad: number;
  vel_end_rad_s: number;
}

interface Exports {
  memory: WebAssembly.Memory;
  __wasm_call_ctors: () => void;
  names: () => number;
  columns: () => number;
  numbers: () => number;
  stand: (angle_rad: number) => void;
  segments: (count: number) => number;
  run: (duration_s: number, pos_end_rad: number, vel_end_rad_s: number, scans: number) => number;
}

export class Core {
  readonly columns: string[];
  private readonly names: { name: string; length: number }[];
  private readonly of: Exports;

  private constructor(of: Exports) {
    this.of = of;
    this.columns = this.lines(of.columns());
    this.names = this.lines(of.names()).map((line) => {
      const [, name = line, length = '1'] = /^(.*)\[(\d+)\]$/.exec(line) ?? [];
      return { name, length: Number(length) };
    });
  }

  static async load(bytes: BufferSource): Promise<Core> {
    const { instance } = await WebAssembly.instantiate(bytes);
    const of = instance.exports as unknown as Exports;
    of.__wasm_call_ctors();
    return new Core(of);
  }

  /** Stand still at an angle, servo on. Throws where a number is missing, has no place or is not finite. */
  stand(numbers: Numbers, angle_rad: number): void {
    const unknown = new Set(Object.keys(numbers));
    const flat = this.names.flatMap(({ name, length }) => {
      const values = [numbers[name] ?? []].flat();
      unknown.delete(name);
      if (values.length !== length || !values.every(Number.isFinite))
        throw new RangeError(`${name}: ${length} finite numbers are needed, ${values} given`);
      return values;
    });
    if (unknown.size > 0) throw new RangeError(`no place for ${[...unknown]}`);
    new Float64Array(this.of.memory.buffer, this.of.numbers(), flat.length).set(flat);
    this.of.stand(angle_rad);
  }

  /** Take the axis through so many scans of a plan; a copy of each column of the log. */
  run(plan: Plan, scans: number): Map<string, Float64Array> {
    const { segments } = plan;
    const room = this.of.segments(segments.length / 5);
    new Float64Array(this.of.memory.buffer, room, segments.length).set(segments);
    const rows = this.of.run(plan.duration_s, plan.pos_end_rad, plan.vel_end_rad_s, scans);
    const values = new Float64Array(this.of.memory.buffer, rows, scans * this.columns.length);
    return new Map(this.columns.map((name, k) => [name, values.slice(k * scans, (k + 1) * scans)]));
  }

  /** Hold an angle. */
  rest(angle_rad: number, scans: number): Map<string, Float64Array> {
    return this.run({ segments: [], duration_s: 0, pos_end_rad: angle_rad, vel_end_rad_s: 0 }, scans);
  }

  private lines(at: number): string[] {
    const bytes = new Uint8Array(this.of.memory.buffer, at);
    return new TextDecoder()
      .decode(bytes.slice(0, bytes.indexOf(0)))
      .trim()
      .split('\n');
  }
}
