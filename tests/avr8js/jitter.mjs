// How even the edges in a table of run.mjs are: node jitter.mjs OUT.csv [INTERVAL_CYCLES]

import { readFileSync } from 'node:fs';

const INTERVAL = 3_600_000; // 225 ms

function rises(edges, pin) {
  return edges.filter((edge) => edge.pin === pin && edge.level === 1).map((edge) => edge.cycle);
}

function spread(values) {
  return Math.max(...values) - Math.min(...values);
}

function report(path, interval) {
  const rows = readFileSync(path, 'utf8').trim().split('\n').slice(1);
  const edges = rows.map((row) => {
    const [cycle, pin, level] = row.split(',');
    return { cycle: Number(cycle), pin, level: Number(level) };
  });
  const laser = rises(edges, 'D9');
  const camera = rises(edges, 'D10');
  const periods = laser.slice(1).map((cycle, i) => cycle - laser[i]);
  const last = laser.length - 1;
  const error = laser[last] - laser[0] - last * interval;
  console.log(`sweeps ${laser.length}, camera pulses ${camera.length}`);
  console.log(`laser period: peak to peak ${spread(periods)} cycles`);
  console.log(`camera - laser: spread ${spread(camera.map((cycle, i) => cycle - laser[i]))} cycles`);
  console.log(`error of sweep ${last}: ${error} cycles = ${(error / 16).toFixed(1)} us`);
  console.log(`LED on: ${rises(edges, 'D6').map((cycle) => cycle - laser[0])} after the first sweep`);
}

const [path, interval] = process.argv.slice(2);
if (!path) {
  console.error('usage: node jitter.mjs OUT.csv [INTERVAL_CYCLES]');
  process.exit(2);
}
report(path, interval ? Number(interval) : INTERVAL);
