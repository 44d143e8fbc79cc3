// NumPy's default generator: PCG64 (O'Neill 2014), seeded by a SeedSequence. For numbers below 2^32.

const MULTIPLIER = 0x2360ed051fc65da44385df649fccf645n;
const ALL_128 = (1n << 128n) - 1n;
const ALL_64 = (1n << 64n) - 1n;
const POOL = 4; // words of a SeedSequence

// Return a SeedSequence's first eight words of 32 bits, for seeds such as [run, episode].
function words(seeds) {
  let hash = 0x43b0d7e5;
  const mixed = (value) => {
    value ^= hash;
    hash = Math.imul(hash, 0x931e8875);
    value = Math.imul(value, hash);
    return value ^ (value >>> 16);
  };
  const merged = (x, y) => {
    const result = (Math.imul(x, 0xca01f9dd) - Math.imul(y, 0x4973f715)) | 0;
    return result ^ (result >>> 16);
  };
  const pool = Array.from({ length: POOL }, (_, i) => mixed(seeds[i] ?? 0));
  for (let from = 0; from < POOL; from++) {
    for (let to = 0; to < POOL; to++) if (from !== to) pool[to] = merged(pool[to], mixed(pool[from]));
  }
  hash = 0x8b51f9dd;
  return Array.from({ length: 8 }, (_, i) => {
    let value = pool[i % POOL] ^ hash;
    hash = Math.imul(hash, 0x58f38ded);
    value = Math.imul(value, hash);
    return (value ^ (value >>> 16)) >>> 0;
  });
}

export class Generator {
  // As `numpy.random.default_rng(seeds)`, of up to four seeds.
  constructor(seeds) {
    const word = words(seeds).map(BigInt);
    const pair = (i) => (((word[i + 1] << 32n) | word[i]) << 64n) | (word[i + 3] << 32n) | word[i + 2];
    this.increment = ((pair(4) << 1n) | 1n) & ALL_128;
    this.state = this.increment; // a step from 0
    this.state = (this.state + pair(0)) & ALL_128;
    this.advance();
    this.half = null; // of the last 64 bits, where only 32 were used
  }

  advance() {
    this.state = (this.state * MULTIPLIER + this.increment) & ALL_128;
  }

  bits64() {
    this.advance();
    const value = (this.state >> 64n) ^ (this.state & ALL_64);
    const turn = this.state >> 122n;
    return ((value >> turn) | (value << ((64n - turn) & 63n))) & ALL_64;
  }

  bits32() {
    if (this.half !== null) {
      const value = this.half;
      this.half = null;
      return value;
    }
    const value = this.bits64();
    this.half = Number(value >> 32n);
    return Number(value & 0xffffffffn);
  }

  // As `uniform(low, high)`.
  uniform(low, high) {
    return low + (high - low) * (Number(this.bits64() >> 11n) / 2 ** 53);
  }

  // As `integers(count)` (Lemire 2019).
  integer(count) {
    const threshold = (2 ** 32 - count) % count;
    for (;;) {
      const product = BigInt(this.bits32()) * BigInt(count);
      if (Number(product & 0xffffffffn) >= threshold) return Number(product >> 32n);
    }
  }
}
