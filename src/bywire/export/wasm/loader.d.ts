/** A parameter that can be set. */
export interface Parameter {
  name: string; unit: string; start: number; low: number | null; high: number | null;
  range: string; meaning: string;
  /** Whether the equations of this structure use the parameter. */
  used: boolean;
}
export interface Signal { name: string; unit: string; label: string }
/** Stimulus of the run; each step is a time and the value from then on. */
export interface Stimulus extends Signal { steps: [number, number][]; low?: number; high?: number }
export interface Description {
  name: string; model: string; duration: number; settle: number; step: number; frame: number;
  recordFrames: number; stimulusFrames: number; stateLength: number; unsettledAt: number; beginsAtRest: boolean;
  choices: Record<string, string | number>;
  parameters: Parameter[]; stimulus: Stimulus[]; signals: Signal[];
}
export interface Options {
  /** By name: an array with one row for each interval of the fastest task, or steps [time, value]. */
  stimulus?: Record<string, Float64Array | [number, number][]>;
  duration?: number;
}
export interface Recording {
  time: Float64Array;
  signals: Record<string, Float64Array>;
  /** All signals in one array: one row per time, in the order of the description. */
  table: Float64Array;
  /** Whether contacts and friction converged in all substeps, and all values are finite. */
  settled: boolean;
}
export interface Brake {
  description: Description;
  /** Exported memory and functions of the module, unchanged. */
  exports: WebAssembly.Exports;
  run(parameters?: Record<string, number>, options?: Options): Recording;
}
export function load(bytes: BufferSource, description: Description): Promise<Brake>;
