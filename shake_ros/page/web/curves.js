// The curves: one time axis for all, minimum and maximum of every pixel, cursor, zoom, pause.
import { ask, look, on, stats } from './socket.js'

const NAMES = ['reference_position', 'position', 'tracking_error', 'reference_velocity', 'estimated_velocity',
  'predicted_velocity', 'reference_acceleration', 'acceleration', 'estimated_acceleration', 'predicted_acceleration',
  'valve_command', 'pressure_a', 'pressure_b', 'pressure_supply', 'twin_acceleration']
export const BLUE = ['#0b5fa5', '#58a6ee'], ORANGE = ['#b85c00', '#f0a050'], GREEN = ['#1b7f4b', '#4cc38a'], GREY = ['#6b7885', '#93a1b0'], VIOLET = ['#7a3fa0', '#c48cf0']
const PANELS = [
  { title: 'Position', unit: 'mm', factor: 1e3, height: 150, least: 2, curves: [['reference', 0, GREY], ['measured', 1, BLUE]] },
  { title: 'Tracking error', unit: 'mm', factor: 1e3, height: 90, least: 0.1, curves: [['reference − measured', 2, ORANGE]] },
  { title: 'Velocity', unit: 'm/s', factor: 1, height: 110, least: 0.02, curves: [['reference', 3, GREY], ['estimate', 4, BLUE], ['model', 5, VIOLET]] },
  { title: 'Acceleration', unit: 'm/s²', factor: 1, height: 150, least: 0.4, curves: [['reference', 6, GREY], ['measured', 7, BLUE], ['estimate', 8, GREEN], ['model', 9, VIOLET], ['twin', 14, ORANGE]] },
  { title: 'Valve command', unit: '%', factor: 100, height: 90, least: 2, curves: [['command', 10, ORANGE]] },
  { title: 'Pressure', unit: 'MPa', factor: 1e-6, height: 110, least: 1, curves: [['A', 11, BLUE], ['B', 12, GREEN], ['supply', 13, GREY]] },
]
const WINDOWS = [1, 2, 5, 10, 20, 30, 60, 120]
let rested = 0, plots = [], span = 10, paused = false, zoom = null, epoch = -1, sampleTime = 0.001, dirty = false
let time = [], values = NAMES.map(() => []), zoomed = null, newest = 0
const element = id => document.getElementById(id)
export const dark = () => document.documentElement.dataset.theme === 'dark' ? 1 : 0

export function level(seconds) {  // buckets no wider than half a pixel of the narrowest curve
  const pixels = Math.max(300, element('charts').clientWidth - 70)
  return Math.max(0, Math.min(7, Math.floor(Math.log2(seconds / sampleTime / pixels))))
}

function take(frame, into) {
  for (let i = 0; i < frame.n; i++) into.time.push((frame.first + i) * frame.step, (frame.first + i + 0.5) * frame.step)
  NAMES.forEach((_, k) => {
    const low = frame.low(k), high = frame.high(k), y = into.values[k]
    for (let i = 0; i < low.length; i++) {
      const a = low[i], b = high[i]
      if (a !== a) y.push(null, null)
      else y.push(a, b)
    }
  })
}

function onFrame(frame) {
  if (frame.epoch !== epoch) clear(frame.epoch)
  let kept = time.length  // the twin's curve comes late: such a frame replaces what is there
  while (kept && time[kept - 1] >= frame.first * frame.step) kept--
  for (const list of [time, ...values]) list.length = kept
  take(frame, { time, values })
  newest = (frame.first + frame.n) * frame.step
  let old = 0
  while (old < time.length && time[old] < newest - span * 1.02) old++
  if (old > time.length / 4 || old > 4000) { time.splice(0, old); values.forEach(y => y.splice(0, old)) }
  draw()
}

function clear(now) { epoch = now; time = []; values = NAMES.map(() => []); if (!paused) zoom = zoomed = null }

// At most 30 times a second, and on a slow machine no more than a third of its time, so that the page always answers.
function draw() {
  if (dirty) return
  dirty = true
  setTimeout(() => requestAnimationFrame(paint), Math.max(0, rested - performance.now()))
}

function paint() {
  const begun = performance.now()
  dirty = false
  const main = document.querySelector('main').dataset.tab
  if (main === 'learn' || document.hidden) return
  stats.draws++
  const data = zoomed && zoom ? zoomed : { time, values }
  const range = zoom || [newest - span, newest]
  let from = 0, to = data.time.length
  while (from < to && data.time[from] < range[0]) from++
  while (to > from && data.time[to - 1] > range[1]) to--
  from = Math.max(0, from - 1)
  const x = data.time.slice(from, to + 1)
  plots.forEach(one => one.show(x, data.values, from, to + 1, range))
  stats.cost = performance.now() - begun
  rested = begun + Math.max(30, 3 * stats.cost)
}

// Bounds on round numbers, kept while they still suit, so that an axis does not tremble with the noise.
function round(low, high, least, rows) {
  if (high - low < least) {
    const middle = Math.round((low + high) / least) * least / 2
    low = Math.min(low, middle - least / 2)
    high = Math.max(high, middle + least / 2)
  }
  const raw = (high - low) / rows * 0.98, decade = 10 ** Math.floor(Math.log10(raw))
  const step = decade * [1, 2, 2.5, 5, 10].find(one => one * decade >= raw)
  const from = Math.floor(low / step + 0.02), to = Math.ceil(high / step - 0.02)
  return { low: Math.min(low, from * step), high: Math.max(high, to * step),
    marks: Array.from({ length: to - from + 1 }, (_, i) => +((from + i) * step).toPrecision(9)) }
}

const fixed = (value, digits) => { const shown = value.toFixed(digits); return +shown === 0 ? shown.replace('-', '') : shown }

export function axisStyle() {
  const css = getComputedStyle(document.documentElement)
  return { stroke: css.getPropertyValue('--quiet').trim(), grid: { stroke: css.getPropertyValue('--line').trim(), width: 1 }, ticks: { show: false }, font: '12px system-ui' }
}

function panel(what) {
  const box = document.createElement('div')
  box.className = 'chart'
  const legend = document.createElement('div')
  legend.className = 'legend'
  legend.innerHTML = `<b>${what.title} <span class="quiet">${what.unit}</span></b>` +
    what.curves.map(([name, , colour]) => `<span><i style="background:${colour[dark()]}"></i>${name} <output>–</output></span>`).join('')
  box.append(legend)
  element('charts').append(box)
  const outputs = [...legend.querySelectorAll('output')]
  const axis = axisStyle()
  const last = what === PANELS[PANELS.length - 1]
  const rows = what.height > 100 ? 4 : 2
  let bounds = round(0, 0, what.least, rows)
  const plot = new uPlot({
    width: Math.max(200, box.clientWidth), height: what.height + (last ? 26 : 0), pxAlign: false,
    padding: [9, 8, last ? 0 : 9, 0],
    scales: { x: { time: false }, y: { range: () => [bounds.low, bounds.high] } },
    axes: [
      { ...axis, show: last, size: 26, values: (_, ticks) => ticks.map(t => `${+t.toFixed(3)} s`) },
      { ...axis, size: 54, splits: () => bounds.marks, values: (_, marks) => marks.map(String) },
    ],
    series: [{}, ...what.curves.map(([, , colour]) => ({ stroke: colour[dark()], width: 1.4, spanGaps: false, points: { show: false } }))],
    legend: { show: false },
    cursor: { sync: { key: 'time' }, drag: { x: true, y: false, dist: 6 }, points: { size: 6 } },
    hooks: {
      setCursor: [u => say(u.cursor.idx)],
      setSelect: [u => { if (u.select.width > 6) zoomTo(u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x')); u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false) }],
    },
  }, [[0, 1], ...what.curves.map(() => [null, null])], box)
  plot.over.addEventListener('dblclick', live)
  let shown = []
  function say(index) {
    outputs.forEach((output, i) => {
      const y = shown[i]
      let at = index == null || index >= (y || []).length ? (y || []).length - 1 : index
      if (index == null) while (at > 0 && y[at] == null) at--
      const value = y && at >= 0 ? y[at] : null
      const digits = what.unit === 'mm' || what.unit === 'MPa' || what.unit === '%' ? 2 : 3
      output.textContent = value == null ? '–' : fixed(value, digits)
    })
  }
  return {
    plot,
    show(x, all, from, to, range) {
      let low = Infinity, high = -Infinity
      shown = what.curves.map(([, k]) => {
        const part = new Array(Math.max(0, to - from))
        for (let i = from; i < to; i++) {
          const raw = all[k][i]
          if (raw == null) { part[i - from] = null; continue }
          const value = raw * what.factor
          part[i - from] = value
          if (value < low) low = value
          if (value > high) high = value
        }
        return part
      })
      if (low > high) { low = 0; high = 0 }
      outputs.forEach((output, i) => { output.parentNode.hidden = !shown[i].some(value => value != null) })
      const wide = bounds.high - bounds.low
      if (low < bounds.low || high > bounds.high || (wide > 1.01 * what.least && high - low < 0.4 * wide)) bounds = round(low, high, what.least, rows)
      plot.setData([x, ...shown], false)
      plot.setScale('x', { min: range[0], max: range[1] })
      if (plot.cursor.idx == null) say(null)
    },
  }
}

function zoomTo(start, stop) {
  if (stop - start < 4 * sampleTime) return
  zoom = [start, stop]
  pauseAt(true)
  element('unzoom').hidden = false
  ask('between', { level: level(stop - start), start, stop })
  draw()
}

function live() { zoom = zoomed = null; element('unzoom').hidden = true; pauseAt(false) }

function pauseAt(now) {
  paused = now
  element('pause').textContent = now ? 'Go on' : 'Pause'
  element('pause').setAttribute('aria-pressed', now)
  if (!now) { zoom = zoomed = null; element('unzoom').hidden = true; clear(epoch) }
  look(level(span), span, paused)
}

function resize() {
  plots.forEach((one, i) => one.plot.setSize({ width: Math.max(200, element('charts').clientWidth), height: one.plot.height }))
  if (!paused) { clear(epoch); look(level(span), span, paused) }
  draw()
}

export function rebuild() {
  plots.forEach(one => one.plot.destroy())
  element('charts').replaceChildren()
  plots = PANELS.map(panel)
  draw()
}

export function begin() {
  element('window').innerHTML = WINDOWS.map(s => `<option value="${s}"${s === span ? ' selected' : ''}>${s} s</option>`).join('')
  element('window').onchange = event => { span = +event.target.value; live() }
  element('pause').onclick = () => pauseAt(!paused)
  element('unzoom').onclick = live
  rebuild()
  let width = element('charts').clientWidth
  new ResizeObserver(() => { if (Math.abs(element('charts').clientWidth - width) > 4) { width = element('charts').clientWidth; resize() } }).observe(element('charts'))
  on('frame', onFrame)
  on('zoom', frame => { zoomed = { time: [], values: NAMES.map(() => []) }; take(frame, zoomed); draw() })
  on('status', status => { sampleTime = status.sample_time })
  on('open', () => { clear(-1); look(level(span), span, paused) })
}
export const shownNow = () => ({ points: time.length, newest, paused, zoom, span, epoch })
export const column = name => values[NAMES.indexOf(name)]
