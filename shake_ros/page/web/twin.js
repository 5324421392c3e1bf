// The twin beside the table: its light, what has changed and what to do, each followed parameter with its 90 % band.
import { axisStyle, BLUE, dark, GREY } from './curves.js'
import { act } from './run.js'
import { fetched, on } from './socket.js'
import { chart, clock, current, put, text, twin } from './state.js'

const A_DATE = 86400 * 365  // s, from which on stamps are a clock's
const when = seconds => seconds > A_DATE ? clock(seconds) : `${+seconds.toFixed(1)} s`
const tab = () => document.querySelector('main').dataset.tab
let since = []  // of the changes, marked in every curve

function light(status) {
  const found = twin(status)
  const start = `<code>./shake twin --ros-args -p table:=${text(status.model || 'TABLE')}${status.lockstep ? ' -p lockstep:=true' : ''}</code>`
  put('twin-light', found ? `${found.dot}${text(found.word)}` : '')
  const words = found && (found.values.state !== 'watching' || !found.level) ? text(found.message) : ''  // else the changes say it
  const over = found ? `stopped at ${clock(Date.now() / 1000 - found.age)}; ${start} starts it again` : `none runs; ${start} starts one`
  put('twin-text', found && !found.lost ? words : `${words} <span class="quiet">${over}</span>`)
}

function release(status) {
  const found = twin(status), on = status.released
  if (!found || found.lost || on == null) { put('twin-release', ''); return }
  put('twin-release', `<div class="row"><button id="release" data-operator>${on ? 'Take back' : 'Release'}</button><span class="${status.release.startsWith('not released') ? 'wrong' : 'quiet'}">${text(status.release || (on ? 'waiting for a window of a sound table' : 'the followed values to observer and controller'))}</span></div>`)
  const button = document.getElementById('release')
  button.disabled = status.role !== 'operator'
  button.onclick = () => act('set', { node: 'twin', name: 'release', value: !on })
}

const change = one => `<div class="trip${one.level < 2 ? ' indicate' : ''}"><b>${text(one.change)}</b> since ${when(one.since)}${one.rivals ? `, or ${text(one.rivals)}` : ''}
  <br><span class="quiet">${text(one.error)}, place ${text(one.place)}</span><br>→ ${text(one.action)}</div>`

function options(width) {
  const axis = axisStyle(), grey = { stroke: GREY[dark()], width: 0.5, points: { show: false } }
  const mark = u => since.forEach(at => { u.ctx.fillStyle = axis.stroke; u.ctx.fillRect(u.valToPos(at, 'x', true), u.bbox.top, 1, u.bbox.height) })
  return {
    width, height: 110, legend: { show: false }, cursor: { show: false }, padding: [8, 12, 0, 0], hooks: { draw: [mark] },
    axes: [{ ...axis, size: 24, space: 70, values: (_, at) => at.map(when) }, { ...axis, size: 54, space: 18 }],
    series: [{}, grey, grey, { stroke: BLUE[dark()], width: 1.6, points: { show: false } }],
    bands: [{ series: [1, 2], fill: `${GREY[dark()]}40` }],
  }
}

async function refresh() {
  if (tab() === 'learn' || !current.status || !twin(current.status)) return
  let found
  try { found = await fetched('/api/twin') } catch (error) { return }
  since = found.changes.map(one => one.since)
  put('twin-changes', [...found.changes].reverse().map(change).join(''))
  put('twin-parameters', found.parameters.map((one, i) => `<div class="chart"><div class="legend"><b>${text(one.name)}</b></div><div id="twin-${i}"></div></div>`).join(''))
  found.parameters.forEach((one, i) => {
    document.querySelector(`#twin-parameters > :nth-child(${i + 1}) .legend`).innerHTML = `<b>${text(one.name.replace(/^effects\./, ''))}</b> ${text(one.text)}`
    chart(`twin-${i}`, found.time.at(-1), options, [found.time, one.high, one.low, one.value])
  })
}

export function begin() {
  on('status', status => { light(status); release(status) })
  setInterval(refresh, 2000)
}
