// The library of recordings, fits as jobs, and what their tables are used for.
import { ask, fetched, on } from './socket.js'
import { current, number as plain, text } from './state.js'
import { act, choices, refresh as refreshControls, show, toast } from './run.js'

const element = id => document.getElementById(id)
const marked = { learn: new Set(), hold: new Set() }
let shown = '', jobsShown = '', asked = '', entries = [], offered = '', declared = ''
const number = (value, factor = 1) => plain(value == null ? null : value * factor)

async function refresh() {
  try { entries = await fetched('/api/recordings') } catch (error) { return }
  const signature = JSON.stringify(entries)
  if (signature === shown) return
  shown = signature
  const rows = entries.map(one => {
    const s = one.summary || {}
    const box = kind => `<td><input type="checkbox" data-mark="${kind}" data-run="${text(one.name)}" aria-label="${kind === 'learn' ? 'estimation' : 'validation'}: ${text(one.name)}"${marked[kind].has(one.name) ? ' checked' : ''}${s.error ? ' disabled' : ''}></td>`
    const findings = s.error ? `<span class="wrong">${text(s.error)}</span>` : (s.findings || []).length ? `<details><summary>${s.findings.length}</summary>${s.findings.map(text).join('<br>')}</details>` : 'none'
    return `<tr>${box('learn')}${box('hold')}<td><b>${text(one.name)}</b>${one.note ? `<br><span class="quiet">${text(one.note)}</span>` : ''}</td><td class="n">${number(s.seconds)}</td><td>${text((one.reference || '–').split('/').pop())}</td><td>${text((one.table || '–').split('/').slice(-2).join('/'))}</td><td class="n">${number(s.peak_position, 1e3)}</td><td class="n">${number(s.peak_velocity)}</td><td class="n">${number(s.peak_acceleration)}</td><td class="n">${number(s.error_rms, 1e3)}</td><td>${findings}</td></tr>`
  })
  element('library').innerHTML = `<h2>Recordings</h2><div class="wide"><table><tr><th>estimation</th><th>validation</th><th>name</th><th class="n">s</th><th>played</th><th>table</th><th class="n">peak mm</th><th class="n">m/s</th><th class="n">m/s²</th><th class="n">error rms, mm</th><th>data checks</th></tr>${rows.join('')}</table></div>` + (rows.length ? '' : '<p class="quiet">none yet: under Run, press Record, then Play; Stop recording when the motion has ended</p>') +
    `<div class="row"><label>declared table <select id="declared"></select></label><button id="identify" data-operator>Identify</button><button id="close-loop" class="go" data-operator>Repair model</button><button id="decide" data-operator>Decide</button><span class="quiet">Identify fits the declared model; Repair model also looks for missing effects; Decide goes on where models stay open: it designs the motion that distinguishes them, asks before the table moves, records, and searches again. Mark one or more recordings for estimation (with much motion, like <i>demo_excitation</i>) and others for validation (like <i>earthquake</i>).</span></div>`
  declared ||= current.status?.model || 'bergamo'  // as the lab was started, until another is chosen
  const tables = choices.table || [declared]
  element('declared').innerHTML = (tables.includes(declared) ? tables : [declared, ...tables]).map(one => `<option value="${text(one)}"${one === declared ? ' selected' : ''}>${text(one.includes('/') ? one.split('/').slice(-2).join('/') : one)}</option>`).join('')
  element('declared').onchange = event => { declared = event.target.value }
  element('library').querySelectorAll('[data-mark]').forEach(box => {
    box.onchange = () => {
      const other = box.dataset.mark === 'learn' ? 'hold' : 'learn'
      marked[box.dataset.mark][box.checked ? 'add' : 'delete'](box.dataset.run)
      if (box.checked) {
        marked[other].delete(box.dataset.run)
        element('library').querySelector(`[data-mark="${other}"][data-run="${CSS.escape(box.dataset.run)}"]`).checked = false
      }
    }
  })
  for (const [id, kind] of [['identify', 'identify'], ['close-loop', 'close_loop'], ['decide', 'decide']]) {
    element(id).disabled = document.body.dataset.role !== 'operator'
    element(id).onclick = () => act('job', { kind, learn: [...marked.learn], hold: [...marked.hold], table: element('declared').value })
  }
}

const KINDS = { identify: 'Identify', close_loop: 'Repair model', decide: 'Decide' }
const WORK = { close_loop: 'search', next_recording: 'next recording', tune: 'gains' }  // beside those that are named well
const kept = ({ seconds, left, part, doing, ...rest }) => rest  // what changes all the time is written in place: a click is not lost
const doing = job => job.state === 'running' && job.work ? `${WORK[job.work] || job.work}: ${job.doing}` : job.doing
const OPEN = {
  close_loop: '<b>Several models remain possible</b><button class="go" data-decide>Decide</button><span class="quiet">designs the motion that distinguishes them, asks before the enabled table moves, records, and searches again</span>',
  decide: '<b>Several models remain possible</b><span class="quiet"><i>Next recording</i> states what no motion distinguishes, and what would</span>',
}
const span = seconds => seconds == null ? '' : seconds > 90 ? `, about ${Math.round(seconds / 60)} min left for this part` : `, about ${Math.round(seconds)} s left for this part`

function jobs(status) {
  const signature = JSON.stringify(status.jobs.map(kept)) + status.role + (status.jobs.at(-1)?.asks ? status.state : '')
  if (signature !== jobsShown) draw(status)
  jobsShown = signature
  for (const job of status.jobs) {
    const card = element('work').querySelector(`[data-job="${job.number}"]`), bar = card.querySelector('progress')
    card.querySelector('.time').textContent = `${Math.round(job.seconds)} s${job.asks ? '' : span(job.left)}`
    card.querySelector('.doing').textContent = doing(job)
    if (job.state === 'running' && !job.part) bar.removeAttribute('value')
    else bar.value = job.part
  }
}

function draw(status) {
  const operator = status.role === 'operator', ready = status.state === 'run'
  const read = new Set([...element('work').querySelectorAll('details[open]')].map(one => one.closest('.job').dataset.job))
  element('work').innerHTML = '<h2>Work</h2>' + (status.jobs.length ? '' : '<p class="quiet">nothing has been started</p>') + [...status.jobs].reverse().map(job => `
    <div class="job" data-job="${job.number}" data-state="${job.state}">
    <div class="row"><b>${text(KINDS[job.of.kind])}</b> <span>${job.asks ? 'waits for your release' : text(job.state)}</span> <span class="quiet time"></span>
    ${job.state === 'running' ? '<button data-cancel>Cancel</button>' : ''}${job.report ? `<button data-report="${text(job.report)}">Report</button>` : ''}${job.next ? `<button data-report="${text(job.next)}">Next recording</button>` : ''}</div>
    ${job.asks ? `<div class="asks" role="alert"><b>The table would move</b><pre>${text(job.asks)}</pre><div class="row"><button class="go" data-release="true" ${operator && ready ? '' : 'disabled'}>Release</button><button data-release="false" ${operator ? '' : 'disabled'}>Stop here</button><span class="quiet">${ready ? 'Release plays and records this motion now' : 'the table does not run: enable it first'}; Stop here ends with the answer so far</span></div></div>` : ''}
    <progress max="1" aria-label="progress"></progress><div class="quiet doing"></div>
    ${job.state === 'done' && job.open ? `<div class="row open">${OPEN[job.of.kind] || ''}</div>` : ''}
    <code>${text(job.command)}</code>
    ${job.lines.length ? `<details${job.state === 'failed' || read.has(String(job.number)) ? ' open' : ''}><summary>Output</summary><pre>${job.lines.map(text).join('\n')}</pre></details>` : ''}
    ${job.table && job.state !== 'running' ? `<div class="row use"><b>Use this table</b> <label><input type="checkbox" data-for="observer" checked> observer</label><label><input type="checkbox" data-for="controller" checked> controller</label>${status.nodes.plant ? '<label><input type="checkbox" data-for="plant"> simulated table (stops it first)</label>' : ''}<button data-use="${text(job.table_path)}" ${operator ? '' : 'disabled'}>Load</button><span class="quiet">then play the same reference again: Runs shows the tracking before and after</span></div>` : ''}</div>`).join('')
  element('work').querySelectorAll('[data-decide]').forEach(button => {
    button.disabled = !operator
    button.onclick = () => act('job', { ...status.jobs.find(job => job.number === +button.closest('.job').dataset.job).of, kind: 'decide' })
  })
  element('work').querySelectorAll('[data-cancel]').forEach(button => { button.onclick = () => act('cancel') })
  element('work').querySelectorAll('[data-release]').forEach(button => { button.onclick = () => act('release', { released: button.dataset.release === 'true' }) })
  element('work').querySelectorAll('[data-report]').forEach(button => { button.onclick = () => openIt(button.dataset.report) })
  element('work').querySelectorAll('[data-use]').forEach(button => {
    button.onclick = async () => {
      const how = { path: button.dataset.use }
      button.closest('.use').querySelectorAll('[data-for]').forEach(box => { how[box.dataset.for] = box.checked })
      button.disabled = true
      await act('table', how)
      button.disabled = false
      refreshControls()
    }
  })
  const last = status.jobs.at(-1)
  const wanted = last && (last.asks ? last.next : (last.state === 'done' || last.report.includes('/decided/')) && last.report)
  if (wanted && wanted !== offered) openIt(offered = wanted)
  if (last) show(last.command)
  if (last?.asks && last.asks !== asked) document.querySelector('.asks').scrollIntoView({ block: 'center' })
  asked = last?.asks
}

function openIt(page) {
  const frame = element('report')
  frame.hidden = false
  frame.src = `/results/${encodeURI(page)}`
}

export function opened() { refreshControls().then(refresh) }

export function begin() {
  let recording = ''
  on('status', status => {
    if (document.querySelector('main').dataset.tab === 'learn') jobs(status)
    if (recording && !status.recording) { shown = ''; setTimeout(refresh, 500) }
    recording = status.recording
  })
  setInterval(() => { if (document.querySelector('main').dataset.tab === 'learn') refresh() }, 3000)
}
