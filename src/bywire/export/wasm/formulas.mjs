// Makes WebAssembly of the formulas that a module carries as a table, see formulas.py.

const OPERATIONS = ("add sub mul neg inv fabs sqrt floor ceil copysign fmax fmin lt le eq ne not "
  + "and or if_else_zero select exp log sin cos pow tan atan tanh").split(" ");
const UNARY = new Set("neg inv fabs sqrt floor ceil not exp log sin cos tan atan tanh".split(" "));
const CALLED = ["exp", "log", "sin", "cos", "pow", "tan", "atan", "tanh"];
const TRUTHS = new Set(["lt", "le", "eq", "ne", "not", "and", "or"]);
const PLAIN = { add: 0xa0, sub: 0xa1, mul: 0xa2, neg: 0x9a, fabs: 0x99, sqrt: 0x9f, floor: 0x9c,
  ceil: 0x9b, copysign: 0xa6, lt: 0x63, le: 0x65, eq: 0x61, ne: 0x62 };
const GET = 0x20, SET = 0x21, TEE = 0x22, LOAD = 0x2b, STORE = 0x39, I32 = 0x7f, F64 = 0x7c;
const NEAR = 64; // values back that a byte of an operand reaches

/** Return a number as the format writes it: seven bits a byte. */
function leb(number) {
  const bytes = [];
  for (; number > 127; number >>>= 7) bytes.push(number & 127 | 128);
  return [...bytes, number];
}

function section(id, items) {
  const body = [...leb(items.length), ...items.flat()];
  return [id, ...leb(body.length), ...body];
}

const named = (name) => [name.length, ...new TextEncoder().encode(name)];

/** Return values (inputs, constants, operations with their operands) and formulas. */
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
    return names[byte === 0 ? number() : byte > NEAR ? often[byte - NEAR - 1] : names.length - byte];
  };
  for (let k = 0; k < count; ++k) {
    const kind = kinds[bytes[6 + k]], op = OPERATIONS[kind >> 4];
    const several = UNARY.has(op) ? 1 : op === "select" ? 3 : 2;
    const isOperand = [1, 2, 3].map((bit) => kind >> bit & 1).slice(0, several);
    const taken = stack.splice(stack.length - isOperand.filter((is) => !is).length);
    const args = isOperand.map((is) => (is ? operand() : taken.shift()));
    (kind & 1 ? names : stack).push(values.length);
    values.push({ op, args });
  }
  for (const each of made) each.results = each.results.map((name) => names[name]);
  return { values, formulas: made };
}

/** Return the body of the function that computes a formula, in a working memory from `base` on. */
function bodyOf({ again, results, places }, values, kept, base) {
  const uses = new Map(), code = [], types = [], locals = new Map();
  const isOther = (v) => !values[v].op || kept.has(v); // there is nothing to compute
  const isTruth = (v) => TRUTHS.has(values[v].op);
  const stack = [...results];
  while (stack.length) {
    const v = stack.pop(), isKnown = uses.has(v);
    uses.set(v, (uses.get(v) ?? 0) + 1);
    if (isKnown || isOther(v)) continue;
    const { op, args } = values[v];
    stack.push(...args);
    if (op === "fmax" || op === "fmin") stack.push(...args); // which read each operand twice
  }
  const emit = (...bytes) => { for (const byte of bytes) code.push(byte); };
  const local = (type) => types.push(type) - (again ? 0 : 1); // behind the argument of a loop
  const access = (opcode, place) => emit(opcode, 3, ...leb(base + 8 * place));
  const load = (place) => { emit(0x41, 0); access(LOAD, place); };
  const zero = () => emit(0x44, 0, 0, 0, 0, 0, 0, 0, 0);
  const isCostly = (v) => !isOther(v) && uses.get(v) === 1
    && (CALLED.includes(values[v].op) || values[v].args.some(isCostly));
  const number = (v) => { value(v); if (isTruth(v)) emit(0xb7); };
  const truth = (v) => { value(v); if (!isTruth(v)) { zero(); emit(PLAIN.ne); } };
  function value(v) {
    if (locals.has(v)) emit(GET, ...leb(locals.get(v)));
    else if (values[v].constant) emit(0x44, ...values[v].constant);
    else compute(v);
  }
  function choose([condition, first, second]) {
    const other = () => second === undefined ? zero() : number(second);
    if (isCostly(first) || second !== undefined && isCostly(second)) {
      truth(condition);
      emit(0x04, F64); number(first); emit(0x05); other(); emit(0x0b);
    } else {
      number(first); other(); truth(condition); emit(0x1b);
    }
  }
  function compute(v) {
    const { op, args } = values[v];
    if (op === "if_else_zero" || op === "select") return choose(args);
    if (op === "inv") emit(0x44, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f);
    if (op === "not" || op === "and" || op === "or") {
      args.forEach(truth);
      return emit({ not: 0x45, and: 0x71, or: 0x72 }[op]);
    }
    args.forEach(number);
    if (op === "fmax" || op === "fmin") {
      args.forEach(number);
      return emit(op === "fmax" ? 0x64 : PLAIN.lt, 0x1b);
    }
    if (op === "inv") return emit(0xa3);
    return CALLED.includes(op) ? emit(0x10, CALLED.indexOf(op)) : emit(PLAIN[op]);
  }
  const order = [...uses.keys()].sort((a, b) => a - b), held = new Map();
  for (const v of order) {
    const place = kept.get(v) ?? values[v].place;
    if (place === undefined) continue;
    load(place);
    locals.set(v, local(F64));
    held.set(place, locals.get(v));
    emit(SET, ...leb(locals.get(v)));
  }
  const all = () => {
    for (const v of order) {
      if (isOther(v) || uses.get(v) < 2) continue;
      compute(v);
      locals.set(v, local(isTruth(v) ? I32 : F64));
      emit(SET, ...leb(locals.get(v)));
    }
  };
  const store = (place, put) => { emit(0x41, 0); put(); access(STORE, place); };
  if (!again) {
    all();
    results.forEach((v, k) => store(places[k], () => number(v)));
  } else {
    const own = places.map((place, k) => {
      if (k && !held.has(place)) {
        load(place);
        held.set(place, local(F64));
        emit(SET, ...leb(held.get(place)));
      }
      return held.get(place);
    });
    emit(0x02, 0x40, 0x03, 0x40); // a block around a loop
    all();
    truth(results[0]);
    emit(0x0d, 1); // leaves both
    results.forEach((v, k) => {
      if (k > again) { emit(GET, ...leb(own[k])); number(v); emit(0xa0, SET, ...leb(own[k])); }
    });
    for (let k = 1; k <= again; ++k) number(results[k]);
    for (let k = again; k >= 1; --k) emit(SET, ...leb(own[k]));
    emit(GET, 0, 0x41, 1, 0x6b, TEE, 0, 0x0d, 0, 0x0b, 0x0b);
    places.forEach((place, k) => { if (k) store(place, () => emit(GET, ...leb(own[k]))); });
    emit(GET, 0);
  }
  const declared = types.map((type) => [1, type]);
  const body = [...leb(declared.length), ...declared.flat(), ...code, 0x0b];
  return [...leb(body.length), ...body];
}

/**
 * Return the functions of a table.
 *
 * `exported` gives the memory and the elementary functions, `base` is where the working memory
 * begins. A formula takes nothing; a loop takes how many turns are left and returns it when it ends.
 */
async function functionsOf(buffer, exported, base) {
  const { values, formulas } = readTable(buffer);
  const first = formulas[0];
  const keeps = new Map(first.results.map((v, k) => [v, first.places[k]]));
  const bodies = formulas.map((each, k) => bodyOf(each, values, k ? keeps : new Map(), base));
  const bytes = Uint8Array.from([
    0, 0x61, 0x73, 0x6d, 1, 0, 0, 0,
    ...section(1, [[0x60, 0, 0], [0x60, 1, I32, 1, I32], [0x60, 1, F64, 1, F64],
      [0x60, 2, F64, F64, 1, F64]]),
    ...section(2, [...CALLED.map((op) => [...named("m"), ...named(op), 0, op === "pow" ? 3 : 2]),
      [...named("m"), ...named("memory"), 2, 0, 1]]),
    ...section(3, formulas.map(({ again }) => [again ? 1 : 0])),
    ...section(7, formulas.map((_, k) => [...named(`${k}`), 0, ...leb(CALLED.length + k)])),
    ...section(10, bodies),
  ]);
  const { instance } = await WebAssembly.instantiate(bytes, { m: exported });
  return formulas.map((_, k) => instance.exports[`${k}`]);
}
