/** A parameter that can be set. */
export interface Parameter {
  name: string; unit: string; start: number; low: number | null; high: number | null;
  range: string; meaning: string;
  /** Whether the equations of this structure use it. */
  used: boolean;
}
export interface Signal { name: string; unit: string; label: string }
/** Stimulus of the run: values from their times on. */
export interface Stimulus extends Signal { steps: [number, number][]; low?: number; high?: number }
export interface Description {
  name: string; model: string; duration: number; settle: number; step: number; frame: number;
  recordFrames: number; stimulusFrames: number; stateLength: number; unsettledAt: number; beginsAtRest: boolean;
  choices: Record<string, string | number>;
  parameters: Parameter[]; stimulus: Stimulus[]; signals: Signal[];
}
export interface Options {
  /** By name: rows, one for each interval of the fastest task, or steps [time, value]. */
  stimulus?: Record<string, Float64Array | [number, number][]>;
  duration?: number;
}
export interface Recording {
  time: Float64Array;
  signals: Record<string, Float64Array>;
  /** The signals as a table: one row per time, in their order. */
  table: Float64Array;
  /** Whether contacts and friction converged in all substeps, and all values are numbers. */
  settled: boolean;
}
export interface Brake {
  description: Description;
  /** Memory and functions of the module, as they are. */
  exports: WebAssembly.Exports;
  run(parameters?: Record<string, number>, options?: Options): Recording;
}
export function load(bytes: BufferSource, description: Description): Promise<Brake>;
