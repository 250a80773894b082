// Generates WebAssembly from a module's table of formulas (written by module.py).

const OPERATIONS = ("add sub mul neg inv fabs sqrt floor ceil copysign fmax fmin lt le eq ne not "
  + "and or if_else_zero select exp log sin cos pow tan atan tanh").split(" ");
const UNARY = new Set("neg inv fabs sqrt floor ceil not exp log sin cos tan atan tanh".split(" "));
const CALLED = ["exp", "log", "sin", "cos", "pow", "tan", "atan", "tanh"];
const TRUTHS = new Set(["lt", "le", "eq", "ne", "not", "and", "or"]);
const PLAIN = { add: 0xa0, sub: 0xa1, mul: 0xa2, neg: 0x9a, fabs: 0x99, sqrt: 0x9f, floor: 0x9c,
  ceil: 0x9b, copysign: 0xa6, lt: 0x63, le: 0x65, eq: 0x61, ne: 0x62 };
const GET = 0x20, SET = 0x21, TEE = 0x22, LOAD = 0x2b, STORE = 0x39, I32 = 0x7f, F64 = 0x7c;
const REACH = 64; // maximum distance to an earlier value in one byte

/** Return a number in LEB128 encoding, seven bits per byte. */
function leb(number) {
  const bytes = [];
  for (; number > 127; number >>>= 7) bytes.push(number & 127 | 128);
  return [...bytes, number];
}

/** Return bytes preceded by their count. */
function counted(...parts) {
  const length = parts.reduce((sum, part) => sum + part.length, 0), start = leb(length);
  const bytes = new Uint8Array(start.length + length);
  let at = 0;
  for (const part of [start, ...parts]) { bytes.set(part, at); at += part.length; }
  return bytes;
}

const section = (id, items) => [[id], counted(leb(items.length), ...items)];

const inBytes = (name) => [name.length, ...new TextEncoder().encode(name)];

/** Return the values (inputs, constants, and operations with their operands) and the formulas. */
function readTable(buffer) {
  const view = new DataView(buffer), bytes = new Uint8Array(buffer);
  const [count, operands, length] = [0, 2, 4].map((at) => view.getUint16(at, true));
  let at = 6 + count, next = at + operands;
  const behind = next + 2 * length;
  const number = () => bytes[next] | bytes[next++ + length] << 8;
  const row = (n) => Array.from({ length: n }, number);
  const steps = (n) => { let sum = 0; return row(n).map((each) => (sum = sum + each & 0xffff)); };
  const inputs = number(), constants = number(), formulas = number();
  const values = steps(inputs).map((place) => ({ place }));
  for (let k = 0; k < constants; ++k)
    values.push({ constant: new Uint8Array(buffer, behind + 8 * k, 8) });
  const made = Array.from({ length: formulas }, () => {
    const again = number(), n = number();
    return { again, results: steps(n), places: steps(n) };
  });
  const kinds = row(number()), often = steps(number());
  const names = values.map((_, k) => k), stack = [];
  const operand = () => {
    const byte = bytes[at++];
    return names[byte === 0 ? number() : byte > REACH ? often[byte - REACH - 1] : names.length - byte];
  };
  for (let k = 0; k < count; ++k) {
    const kind = kinds[bytes[6 + k]], op = OPERATIONS[kind >> 4];
    const several = UNARY.has(op) ? 1 : op === "select" ? 3 : 2;
    const isOperand = [1, 2, 3].map((bit) => kind >> bit & 1).slice(0, several);
    const taken = stack.splice(stack.length - isOperand.filter((is) => !is).length);
    const args = isOperand.map((is) => (is ? operand() : taken.shift()));
    (kind & 1 ? names : stack).push(values.length);
    values.push({ op, args, isTruth: TRUTHS.has(op) });
  }
  for (const each of made) each.results = each.results.map((name) => names[name]);
  return { values, formulas: made };
}

/** Return the body of the function that computes a formula in the working memory at `base`. */
function bodyOf({ again, results, places }, values, kept, base) {
  const uses = new Uint32Array(values.length), locals = new Int32Array(values.length).fill(-1);
  const code = [], types = [], held = new Map(); // held: locals for values in memory, by place
  const isOther = (v) => !values[v].op || kept.has(v); // needs no computation
  const stack = [...results];
  while (stack.length) {
    const v = stack.pop();
    if (uses[v]++ || isOther(v)) continue;
    const { op, args } = values[v];
    stack.push(...args);
    if (op === "fmax" || op === "fmin") stack.push(...args); // these read each operand twice
  }
  const at = (opcode, number) => { // an instruction with its operand
    code.push(opcode);
    for (; number > 127; number >>>= 7) code.push(number & 127 | 128);
    code.push(number);
  };
  const local = (type) => types.push(type) - (again ? 0 : 1); // a loop's argument comes first
  const load = (place) => { code.push(0x41, 0, LOAD); at(3, base + 8 * place); };
  const zero = () => code.push(0x44, 0, 0, 0, 0, 0, 0, 0, 0);
  const isCostly = (v) => !isOther(v) && uses[v] === 1
    && (CALLED.includes(values[v].op) || values[v].args.some(isCostly));
  const number = (v) => { value(v); if (values[v].isTruth) code.push(0xb7); };
  const truth = (v) => { value(v); if (!values[v].isTruth) { zero(); code.push(PLAIN.ne); } };
  function value(v) {
    if (locals[v] >= 0) at(GET, locals[v]);
    else if (values[v].constant) code.push(0x44, ...values[v].constant);
    else compute(v);
  }
  function choose([condition, first, second]) {
    const other = () => second === undefined ? zero() : number(second);
    if (isCostly(first) || second !== undefined && isCostly(second)) {
      truth(condition);
      code.push(0x04, F64); number(first); code.push(0x05); other(); code.push(0x0b);
    } else {
      number(first); other(); truth(condition); code.push(0x1b);
    }
  }
  function compute(v) {
    const { op, args } = values[v];
    if (op === "if_else_zero" || op === "select") return choose(args);
    if (op === "inv") code.push(0x44, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f);
    if (op === "not" || op === "and" || op === "or") {
      args.forEach(truth);
      return code.push({ not: 0x45, and: 0x71, or: 0x72 }[op]);
    }
    args.forEach(number);
    if (op === "fmax" || op === "fmin") {
      args.forEach(number);
      return code.push(op === "fmax" ? 0x64 : PLAIN.lt, 0x1b);
    }
    if (op === "inv") return code.push(0xa3);
    return CALLED.includes(op) ? code.push(0x10, CALLED.indexOf(op)) : code.push(PLAIN[op]);
  }
  const hold = (place) => {
    load(place);
    held.set(place, local(F64));
    at(SET, held.get(place));
    return held.get(place);
  };
  const all = () => {
    for (let v = 0; v < uses.length; ++v) {
      if (uses[v] < 2 || isOther(v)) continue;
      compute(v);
      locals[v] = local(values[v].isTruth ? I32 : F64);
      at(SET, locals[v]);
    }
  };
  const store = (place, put) => {
    code.push(0x41, 0); put(); code.push(STORE); at(3, base + 8 * place);
  };
  for (let v = 0; v < uses.length; ++v) {
    const place = uses[v] ? kept.get(v) ?? values[v].place : undefined;
    if (place !== undefined) locals[v] = hold(place);
  }
  if (!again) {
    all();
    results.forEach((v, k) => store(places[k], () => number(v)));
  } else {
    const own = places.map((place, k) => (k ? held.get(place) ?? hold(place) : 0));
    code.push(0x02, 0x40, 0x03, 0x40); // a block around a loop
    all();
    truth(results[0]);
    code.push(0x0d, 1); // leave both
    results.forEach((v, k) => {
      if (k > again) { at(GET, own[k]); number(v); code.push(0xa0); at(SET, own[k]); }
    });
    for (let k = 1; k <= again; ++k) number(results[k]);
    for (let k = again; k >= 1; --k) at(SET, own[k]);
    code.push(GET, 0, 0x41, 1, 0x6b, TEE, 0, 0x0d, 0, 0x0b, 0x0b);
    places.forEach((place, k) => { if (k) store(place, () => at(GET, own[k])); });
    code.push(GET, 0);
  }
  code.push(0x0b);
  return counted(leb(types.length), types.flatMap((type) => [1, type]), code);
}

/**
 * Return the functions of a table.
 *
 * `exported` contains the memory and the elementary functions; `base` is the address of the working memory.
 * A formula takes no argument. A loop takes the number of remaining turns and returns it when it ends.
 */
async function functionsOf(buffer, exported, base) {
  const { values, formulas } = readTable(buffer);
  const first = formulas[0];
  const keeps = new Map(first.results.map((v, k) => [v, first.places[k]]));
  const bodies = formulas.map((each, k) => bodyOf(each, values, k ? keeps : new Map(), base));
  const parts = [
    [0, 0x61, 0x73, 0x6d, 1, 0, 0, 0],
    ...section(1, [[0x60, 0, 0], [0x60, 1, I32, 1, I32], [0x60, 1, F64, 1, F64],
      [0x60, 2, F64, F64, 1, F64]]),
    ...section(2, [...CALLED.map((op) => [...inBytes("m"), ...inBytes(op), 0, op === "pow" ? 3 : 2]),
      [...inBytes("m"), ...inBytes("memory"), 2, 0, 1]]),
    ...section(3, formulas.map(({ again }) => [again ? 1 : 0])),
    ...section(7, formulas.map((_, k) => [...inBytes(`${k}`), 0, ...leb(CALLED.length + k)])),
    ...section(10, bodies),
  ];
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => { bytes.set(part, at); return at + part.length; }, 0);
  const { instance } = await WebAssembly.instantiate(bytes, { m: exported });
  return formulas.map((_, k) => instance.exports[`${k}`]);
}
