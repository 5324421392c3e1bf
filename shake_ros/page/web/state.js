// State at a glance: the interlock, the nodes, trips, spectra, harmonics, runs.
import { ask, on, stats } from './socket.js'
import { axisStyle, BLUE, column, dark, GREY } from './curves.js'

const element = id => document.getElementById(id)
export const text = value => String(value ?? '').replace(/[&<>"']/g, c => `&#${c.charCodeAt(0)};`)
export const clock = seconds => new Date(seconds * 1000).toLocaleTimeString('en-GB')
// Three digits, no exponent, no more than so many decimals.
export const number = (value, digits = 3, decimals = 4) => {
  if (value == null || value === '' || Number.isNaN(+value)) return '–'
  const size = Math.abs(+value), before = size > 0 ? Math.floor(Math.log10(size)) : 0
  const shown = (+value).toFixed(Math.max(0, Math.min(decimals, digits - 1 - before)))
  return +shown === 0 ? '0' : shown
}
// Causes of a machine that does not hold the loop's rate, where the table is simulated.
const SLOW = ['deadline_overruns', 'stale_command']
const HINT = '<div class="quiet">This machine does not hold the rate in real time: end the lab and start it with <code>--lockstep</code>, which waits for every sample.</div>'
const WORDS = { run: 'run', off: 'off', hold: 'hold', tripped: 'tripped', starting: 'starting', lost: 'table lost', unknown: '…' }
export const current = { status: null }
export const put = (id, html) => { const box = element(id); if (box.dataset.shown !== html) { box.dataset.shown = html; box.innerHTML = html } }

// The twin's light: green, amber, red; grey while it learns what is normal and when it has stopped.
export function twin(status) {
  const node = Object.values(status.nodes).find(one => one.part === 'twin')
  if (!node) return null
  const state = node.lost ? 'stopped' : node.values.state, grey = ['stopped', 'waiting', 'learning'].includes(state) && (node.lost || !node.level)
  const word = state === 'watching' ? ['unchanged', 'changed', 'fault'][node.level] : state
  return { ...node, state, word, dot: `<i class="dot ${grey ? 'grey' : `l${node.level}`}"></i>` }
}

function peak(name, factor) {
  let most = 0
  for (const value of column(name)) if (value != null && Math.abs(value) > most) most = Math.abs(value)
  return most * factor
}

function rms(name, factor) {
  let sum = 0, n = 0
  for (const value of column(name)) if (value != null) { sum += value * value; n++ }
  return n ? Math.sqrt(sum / n) * factor : null
}

function header(status) {
  document.body.dataset.state = status.state
  element('state-word').textContent = WORDS[status.state] || status.state
  element('state-text').textContent = status.message
  const operator = status.role === 'operator'
  document.body.dataset.role = status.role
  document.querySelectorAll('[data-operator]').forEach(one => { one.disabled = !operator || one.dataset.off === 'true' })
  const enable = element('enable'), on = status.stage && status.stage !== 'off'
  enable.textContent = on ? 'Disable' : 'Enable'
  enable.classList.toggle('go', !on)
  enable.disabled = !operator || ['tripped', 'stopped', 'lost', 'starting'].includes(status.state) || status.message.endsWith('waiting for reset')
  element('reset').disabled = !operator || !['tripped', 'stopped', 'hold'].includes(status.state)
  element('stop').disabled = status.role === 'spectator'
  const table = status.nodes.plant || status.nodes.hardware_bridge
  const facts = [`<span>span <b>${number(status.span, 3)}</b></span>`]
  if (table) facts.push(`<span>${status.lockstep ? 'lock-step' : 'real time'} <b>${Math.round(table.values.rate_hz)} Hz</b></span>`, `<span>missed <b>${table.values.missed_deadlines}</b></span>`)
  for (const [name, value] of Object.entries(status.words)) facts.push(`<span>${name} <b>${text(value.split('/').slice(-2).join('/'))}</b></span>`)
  const beside = twin(status)
  if (beside) facts.push(`<span>${beside.dot}twin <b>${text(beside.word)}</b></span>`)
  if (status.jobs.at(-1)?.asks) facts.push('<span class="asking">● a motion waits for your release under Learn</span>')
  if (status.recording) facts.push(status.records ? `<span class="rec">● recording ${text(status.recording.split('/').pop())} ${Math.round(status.recording_for)} s</span>` : '<span>○ recorder starting: wait before you play</span>')
  put('facts', facts.join(''))
  const seat = { operator: 'you have the controls', waiting: status.taken ? 'another page has the controls <button id="take">Take them</button>' : '', spectator: 'spectator: read only' }
  put('seat', `<span class="quiet">${seat[status.role]}</span>`)
  if (element('take')) element('take').onclick = () => ask('take')
}

function alarms(status) {
  const lost = Object.entries(status.nodes).filter(([name, node]) => node.lost && name in Object.fromEntries(status.processes.map(p => [p, 1])))
  const lines = Object.entries(status.died).map(([name, why]) => `<span>${text(name)} died: ${text(why)}</span>` + (status.lab ? `<button data-restart="${text(name)}">Start ${text(name)} again</button>` : ''))
  for (const [name] of lost) if (!(name in status.died)) lines.push(`<span>${text(name)} is silent</span>`)
  const box = element('alert')
  box.hidden = !lines.length
  put('alert', lines.join(''))
  box.querySelectorAll('[data-restart]').forEach(button => { button.onclick = () => ask('restart', { name: button.dataset.restart }) })
}

function tiles(status) {
  const table = status.nodes.plant || status.nodes.hardware_bridge
  const model = status.model_error.acceleration, supply = column('pressure_supply').at(-1)
  const list = [
    ['position, peak', peak('position', 1e3), 'mm'], ['tracking error, rms', rms('tracking_error', 1e3), 'mm'],
    ['acceleration, peak', peak('acceleration', 1), 'm/s²'],
    ['supply pressure', supply == null ? null : supply * 1e-6, 'MPa'],
    ['THD', status.thd.thd_percent, '%'],
    ['model against measured', model == null ? null : 100 * model, '%'],
  ]
  put('tiles', list.map(([what, value, unit]) => `<div class="tile"><b>${number(value, 3, 3)} <small>${unit}</small></b><span>${what}</span></div>`).join(''))
}

// A cause that comes and goes, as a stale command does on a busy machine, is one entry with how often.
const AGAIN = 2  // s between two of them
export function folded(trips) {
  const found = []
  for (const trip of trips) {
    const last = found.at(-1)
    if (last && trip.cause !== 'fault' && last.cause === trip.cause && last.action === trip.action && trip.at - last.until < AGAIN) Object.assign(last, { ...trip, at: last.at, until: trip.at, times: last.times + 1 })
    else found.push({ ...trip, until: trip.at, times: 1 })
  }
  return found
}

function nodes(status) {
  const rows = Object.entries(status.nodes).map(([name, node]) => {
    const v = node.values, lost = Object.entries(v).filter(([key]) => key.endsWith('.lost')).reduce((sum, [, n]) => sum + +n, 0)
    const latency = v.latency_p99_us ? `${(v.latency_p99_us / 1000).toFixed(2)}` : '–'
    return `<tr title="${text(node.message)}"><td><i class="dot ${node.lost ? 'lost' : 'l' + node.level}"></i>${text(name)}</td><td class="n">${node.lost ? 'lost' : Math.round(v.rate_hz)}</td>` +
      `<td class="n">${v.missed_deadlines}</td><td class="n">${latency}</td><td class="n">${lost}</td></tr>`
  })
  put('nodes', `<div class="wide"><table><tr><th>node</th><th class="n">Hz</th><th class="n">missed</th><th class="n" title="99th percentile of the latency">p99, ms</th><th class="n">lost</th></tr>${rows.join('')}</table></div>`)
  const slow = status.nodes.plant && !status.lockstep && status.trips.some(trip => SLOW.includes(trip.cause))
  const trips = folded(status.trips).slice(-8).reverse().map(trip => `<div class="trip ${text(trip.action || trip.cause)}"><b>${text(trip.cause)}${trip.times > 1 ? ` × ${trip.times}` : ''}</b> ${clock(trip.at)}` +
    (trip.value && trip.cause !== 'stop' ? `, value ${number(trip.value)} against ${number(trip.limit)} ${text(trip.unit === '-' ? '' : trip.unit)}` : '') + `<br><span class="quiet">${text(trip.text)}${trip.action ? ` → ${text(trip.action)}` : ''}</span></div>`)
  const before = ['tripped', 'stopped', 'hold'].includes(status.state) ? `<div class="trip">${text(status.message)}<br><span class="quiet">since before this page was opened</span></div>` : ''
  put('trips', (slow ? HINT : '') + trips.join('') || before || '<span class="quiet">none since the page was opened</span>')
}

const small = {}
export function chart(id, key, make, data) {
  const box = element(id)
  if (!data || !data[0] || !data[0].length) { put(id, '<span class="quiet">nothing yet</span>'); delete small[id]; return }
  if (!small[id] || small[id].plot.root.parentNode !== box || small[id].box !== box.clientWidth || small[id].theme !== document.documentElement.dataset.theme) {
    if (!box.clientWidth) return
    box.replaceChildren(); box.dataset.shown = ''
    small[id] = { plot: new uPlot(make(box.clientWidth), data, box), box: box.clientWidth, theme: document.documentElement.dataset.theme }
  } else if (small[id].key !== key) small[id].plot.setData(data)
  small[id].key = key
}

// Logarithmic axes as logarithms on linear ones: lines at 1, 2, 5 of each decade across, at each decade up.
const decades = (low, high, marks) => {
  const found = []
  for (let d = Math.floor(low); d <= Math.ceil(high); d++) for (const m of marks) { const at = d + Math.log10(m); if (at >= low - 1e-6 && at <= high + 1e-6) found.push(at) }
  return found
}
const plain = at => { const v = 10 ** at; return v >= 0.001 && v < 10000 ? String(+v.toPrecision(2)) : v.toExponential(0) }

function options(width, x, y, series, logY) {
  const axis = { ...axisStyle(), labelFont: '12px system-ui', labelSize: 16 }
  const log = marks => ({ splits: (u, i, low, high) => decades(low, high, marks), values: (u, splits) => splits.map(plain) })
  return {
    width, height: 180, legend: { show: false }, cursor: { show: false }, padding: [8, 12, 0, 0],
    scales: { x: { time: false, range: (u, low, high) => [low, high] }, y: logY ? { range: (u, low, high) => [Math.max(low, high - 5), high + 0.2] } : { range: (u, low, high) => [0, high * 1.08 || 1] } },
    axes: [{ ...axis, label: x, size: 26, ...log([1, 2, 5]) }, { ...axis, label: y, size: 50, ...(logY ? log([1]) : {}) }],
    series: [{}, ...series.map(stroke => ({ stroke, width: 1.4, points: { show: false } }))],
  }
}

function spectra(status) {
  const s = status.spectrum, colours = [BLUE[dark()], GREY[dark()]]
  const log = values => (values || []).map(v => Math.log10(Math.max(v, 1e-7)))
  const full = s.frequency && s.frequency.length && Math.max(...s.acceleration) > 0
  chart('spectrum', status.time, w => options(w, 'Hz', 'm/s²', colours, true), full ? [log(s.frequency), log(s.acceleration), log(s.reference_acceleration)] : null)
  const run = status.last_run
  chart('response', run && run.ended, w => options(w, 'natural period, s; 5 % damping', 'm/s²', colours, false), run ? [log(run.periods), run.spectrum, run.wanted] : null)
  element('thd').textContent = status.thd.thd_percent ? `THD ${number(status.thd.thd_percent)} % of ${number(status.thd.fundamental_frequency_hz)} Hz` : ''
  const top = status.harmonics.slice(0, 10)
  put('harmonics', top.length ? `<table><tr><th>order</th><th class="n">Hz</th><th class="n">m/s²</th><th class="n">of the first</th></tr>${top.map(([k, f, a]) => `<tr><td>${k}</td><td class="n">${number(f)}</td><td class="n">${number(a)}</td><td class="n">${(100 * a / (top[0][2] || 1)).toFixed(2)} %</td></tr>`).join('')}</table>` : '<span class="quiet">none while nothing periodic plays</span>')
}

function runs(status) {
  const rows = status.runs.slice(-6).reverse().map((run, i) => `<tr><td>${clock(run.ended)}</td><td title="${text(run.reference)}">${text((run.reference || '').split('/').pop())}</td><td title="${text(run.controller)}, ${text(run.observer)}">${text((run.controller || '').split('/').slice(-2).join('/'))}</td><td class="n">${number(run.error_rms * 1e3)}</td><td class="n">${run.error_relative == null ? '–' : (100 * run.error_relative).toFixed(2)}</td></tr>`)
  put('runs', rows.length ? `<div class="wide"><table><tr><th>ended</th><th>reference</th><th>controller</th><th class="n">error rms, mm</th><th class="n">%</th></tr>${rows.join('')}</table></div>` : '<span class="quiet">none yet: play a reference</span>')
}

export function begin() {
  on('status', status => {
    current.status = status
    header(status); alarms(status)
    if (document.querySelector('main').dataset.tab === 'watch') { tiles(status); nodes(status); spectra(status); runs(status) }
  })
  on('close', () => {
    document.body.dataset.state = 'disconnected'
    element('state-word').textContent = 'disconnected'
    element('state-text').textContent = 'the laboratory does not answer; what is shown is old. Trying again; a lab that was started anew has a new address.'
    element('alert').hidden = true
    document.querySelectorAll('[data-operator], #stop').forEach(one => { one.disabled = true })
  })
  let before = { ...stats }, at = performance.now()
  setInterval(() => {
    const now = performance.now(), seconds = (now - at) / 1000
    stats.framesPerSecond = (stats.frames - before.frames) / seconds
    stats.drawsPerSecond = (stats.draws - before.draws) / seconds
    element('pace').textContent = `${stats.framesPerSecond.toFixed(0)} frames/s`
    before = { ...stats }; at = now
  }, 1000)
}
