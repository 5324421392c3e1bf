// Controls: enable, stop, reset; reference, gain, laws, recording, every live parameter. Each shows its command line.
import { ask, fetched, on } from './socket.js'
import { current, text } from './state.js'

const element = id => document.getElementById(id)
const quoted = value => /^[\w./:+-]+$/.test(String(value)) ? String(value) : `'${String(value).replace(/'/g, "'\\''")}'`
export const choices = {}
const refused = {}  // node.parameter → why its last value was refused
let parameters = {}, shownFor = '', columns = '', component = ''

export function toast(message, wrong) {
  const line = document.createElement('div')
  line.textContent = message
  line.className = wrong ? 'wrong' : ''
  element('toast').append(line)
  while (element('toast').children.length > 4) element('toast').firstChild.remove()
  setTimeout(() => line.remove(), wrong ? 9000 : 3500)
}

export function show(command) { element('command').textContent = command }

const LINES = {
  enable: how => `./shake ros2 service call /shake/enable std_srvs/srv/SetBool "{data: ${how.on}}"`,
  stop: () => './shake ros2 service call /shake/stop std_srvs/srv/Trigger',
  reset: () => './shake ros2 service call /shake/reset std_srvs/srv/Trigger',
  set: how => `./shake ros2 param set /shake/${how.node} ${how.name} ${quoted(how.value)}`,
  record: how => `./shake recorder --ros-args -p output:=out/lab/recordings/${how.name}`,
  stop_recording: () => 'Ctrl-C in the recorder’s terminal',
  restart: how => `./shake ${how.name}`,
  table: how => `./shake plant --ros-args -p table:=${quoted(how.path)}`,
}

export async function act(what, how = {}) {
  if (LINES[what]) show(LINES[what](how))
  const answer = await ask(what, how)
  toast(answer.text || what, !answer.ok)
  return answer
}

export const stop = () => act('stop')

// Another reference begins with *Play*, not when it is chosen, unless one is playing, which then goes over to it.
async function choose(value) {
  const plays = current.status?.nodes?.reference_generator
  if (plays?.message?.endsWith('ended')) await act('set', { node: 'reference_generator', name: 'play', value: false })
  return act('set', { node: 'reference_generator', name: 'reference', value })
}

function select(node, name, options, value) {
  const known = options.includes(value) || value == null ? options : [value, ...options]
  const shown = one => one.includes('/') ? one.split('/').slice(-2).join('/') : one
  return `<select data-operator data-node="${node}" data-name="${name}">${known.map(one => `<option value="${text(one)}"${one === value ? ' selected' : ''}>${text(shown(one))}</option>`).join('')}</select>`
}

function field(node, one, label) {
  const range = one.low != null && one.high != null ? `${+one.low.toPrecision(4)} … ${+one.high.toPrecision(4)}` : one.low != null ? `from ${+one.low.toPrecision(4)}` : one.high != null ? `up to ${+one.high.toPrecision(4)}` : ''
  const why = refused[`${node}.${one.name}`]
  const id = `p-${node}-${one.name.replace(/\W/g, '-')}`
  const off = one.live ? 'data-operator' : 'disabled'
  const input = one.kind === 'bool' ? `<select id="${id}" ${off} data-node="${node}" data-name="${one.name}" data-kind="bool"><option${one.value ? '' : ' selected'}>false</option><option${one.value ? ' selected' : ''}>true</option></select>`
    : one.names.length ? `<select id="${id}" ${off} data-node="${node}" data-name="${one.name}">${one.names.map(n => `<option${n === one.value ? ' selected' : ''}>${text(n)}</option>`).join('')}</select>`
      : `<input id="${id}" ${off} data-node="${node}" data-name="${one.name}" data-kind="${one.kind}" value="${text(typeof one.value === 'number' ? +one.value.toPrecision(8) : one.value)}" inputmode="${one.kind === 'str' ? 'text' : 'decimal'}">`
  return `<div class="field"><label for="${id}">${text(label || one.name)}</label>${input}<span class="quiet">${text(one.unit === '-' ? '' : one.unit)}</span><small>${text(one.meaning)}${range ? ` (${range})` : ''}</small>${why ? `<small class="wrong">${text(why)}</small>` : ''}</div>`
}

const find = (node, name) => (parameters[node] || []).find(one => one.name === name)

function listen(box) {
  box.querySelectorAll('[data-name]').forEach(input => {
    input.onchange = async () => {
      const raw = input.value, kind = input.dataset.kind
      const value = kind === 'bool' ? raw === 'true' : kind === 'float' || kind === 'int' ? (raw.trim() === '' || Number.isNaN(+raw) ? raw : +raw) : raw
      const chosen = input.dataset.node === 'reference_generator' && input.dataset.name === 'reference'
      const answer = await (chosen ? choose(value) : act('set', { node: input.dataset.node, name: input.dataset.name, value }))
      const name = `${input.dataset.node}.${input.dataset.name}`
      if (answer.ok) delete refused[name]
      else refused[name] = `${raw}: ${answer.text}`
      shownFor = ''
      setTimeout(refresh, 700)
    }
  })
  const operator = document.body.dataset.role === 'operator'
  box.querySelectorAll('[data-operator]').forEach(one => { one.disabled = !operator })
}

export async function refresh() {
  try {
    Object.assign(choices, await fetched('/api/choices'))
    parameters = await fetched('/api/parameters')
  } catch (error) { return }
  const signature = JSON.stringify([choices, parameters])
  if (signature === shownFor || element('run').contains(document.activeElement) && document.activeElement.tagName === 'INPUT') return
  shownFor = signature
  const value = (node, name) => find(node, name)?.value
  const live = (parameters.reference_generator || []).filter(one => one.live && !['reference', 'play', 'repeat'].includes(one.name))
  const first = ['amplitude', 'frequency', 'scale', 'start_frequency', 'end_frequency', 'peak_position']
  const main = live.filter(one => first.includes(one.name)), rest = live.filter(one => !first.includes(one.name))
  element('reference').innerHTML = `<div class="row">${select('reference_generator', 'reference', choices.reference || [], value('reference_generator', 'reference'))}</div>
    <div class="row"><button id="play" class="go" data-operator>Play</button><button id="rest" data-operator>Stop playing</button>
    <label><input type="checkbox" id="repeat" data-operator ${value('reference_generator', 'repeat') ? 'checked' : ''}> repeat</label></div>
    ${main.map(one => field('reference_generator', one)).join('')}
    ${rest.length ? `<details><summary>More of this reference</summary>${rest.map(one => field('reference_generator', one)).join('')}</details>` : ''}
    <div class="row"><label for="upload">Accelerogram</label><input type="file" id="upload" data-operator><select id="unit" title="unit, where the file names none"><option value="">unit as the file says</option><option>g</option><option>m/s2</option><option>cm/s2</option></select><input type="number" id="component" min="1" max="999" placeholder="component" value="${component}" title="component of a file that holds several" style="width:9.5rem"></div><pre id="columns"${columns ? '' : ' hidden'}>${text(columns)}</pre>`
  element('play').onclick = () => act('set', { node: 'reference_generator', name: 'play', value: true })
  element('rest').onclick = () => act('set', { node: 'reference_generator', name: 'play', value: false })
  element('repeat').onchange = event => act('set', { node: 'reference_generator', name: 'repeat', value: event.target.checked })
  element('upload').onchange = upload
  element('component').onchange = event => { component = event.target.value }
  const table = parameters.plant ? 'plant' : 'hardware_bridge', span = find(table, 'interlock.span'), time = find(table, 'interlock.span_time')
  element('gain').innerHTML = span ? `<div class="row"><input type="range" min="0" max="1" step="0.01" value="${span.value}" id="span" data-operator style="flex:1" aria-label="master gain"><output id="span-value">${Math.round(100 * span.value)} %</output></div><small class="quiet">of the valve command; goes there within ${time ? time.value : '?'} s</small>` : '<span class="quiet">no table</span>'
  if (span) {
    element('span').oninput = event => { element('span-value').textContent = `${Math.round(100 * event.target.value)} %` }
    element('span').onchange = event => act('set', { node: table, name: 'interlock.span', value: +event.target.value })
  }
  element('laws').innerHTML = `<div class="field"><span>controller</span>${select('controller', 'controller', choices.controller || [], value('controller', 'controller'))}</div><div class="field"><span>observer</span>${select('observer', 'observer', choices.observer || [], value('observer', 'observer'))}</div>`
  const open = new Set([...element('parameters').querySelectorAll('details[open]')].map(one => one.dataset.group))
  element('parameters').innerHTML = Object.entries(parameters).map(([node, list]) => {
    const shown = list.filter(one => one.live)
    return shown.length ? `<details data-group="${node}"${open.has(node) ? ' open' : ''}><summary>${node} <span class="quiet">${shown.length}</span></summary>${shown.map(one => field(node, one)).join('')}</details>` : ''
  }).join('')
  for (const id of ['reference', 'laws', 'parameters', 'gain']) listen(element(id))
}

async function upload(event) {
  const file = event.target.files[0]
  if (!file) return
  try {
    const made = await fetched(`/api/upload?name=${encodeURIComponent(file.name)}&unit=${encodeURIComponent(element('unit').value)}&channel=${encodeURIComponent(element('component').value)}`, { method: 'POST', body: file })
    columns = made.columns ? `not an accelerogram, but a recording to import:\n${made.columns}` : ''
    element('columns').textContent = columns
    element('columns').hidden = !columns
    if (!columns) {
      toast(`${file.name} can be played`)
      await choose(made.reference)
    }
  } catch (error) { toast(error.message, true) }
  event.target.value = ''
  shownFor = ''
  refresh()
}

function recording(status) {
  const box = element('recording'), running = status.recording ? 'stop' : status.lab ? 'start' : 'none'
  if (box.dataset.for === running) return
  box.dataset.for = running
  if (running === 'none') { box.innerHTML = '<span class="quiet">recordings are started on the page only under ./shake lab</span>'; return }
  box.innerHTML = running === 'stop' ? `<div class="row"><button id="unrecord" class="stop">Stop recording</button></div>`
    : `<div class="row"><input type="text" id="record-name" placeholder="name" aria-label="name of the recording" pattern="[\\w.\\-]+" data-operator><button id="record" data-operator>Record</button></div><div class="row"><input type="text" id="record-note" placeholder="note (shift + space while the table runs)" aria-label="note" data-operator></div>`
  if (running === 'stop') element('unrecord').onclick = () => act('stop_recording')
  else {
    const name = element('record-name')
    name.value = `run_${new Date().toISOString().slice(5, 19).replace(/[-:T]/g, '')}`
    element('record').onclick = () => act('record', { name: name.value, note: element('record-note').value })
  }
}

export function begin() {
  element('enable').onclick = () => act('enable', { on: !(current.status && current.status.stage !== 'off' && current.status.stage) })
  element('reset').onclick = () => act('reset')
  element('stop').onclick = stop
  element('spectators').onclick = async () => {
    try {
      const found = await fetched('/api/spectators')
      show(found.url)
      toast('the spectators’ address stands at the foot of the page; copy it')
    } catch (error) { toast(error.message, true) }
  }
  let known = ''
  on('status', status => {
    recording(status)
    const now = JSON.stringify([status.words, Object.keys(status.nodes), status.role, status.play])
    if (now !== known) { known = now; setTimeout(refresh, 300) }
  })
  setInterval(() => { if (document.querySelector('main').dataset.tab === 'run') refresh() }, 3000)
}
