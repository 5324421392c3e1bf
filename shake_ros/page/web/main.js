// Puts the page together: tabs, theme, the space bar.
import { connect, on, stats } from './socket.js'
import * as curves from './curves.js'
import * as state from './state.js'
import * as run from './run.js'
import * as learn from './learn.js'
import * as twin from './twin.js'

const root = document.documentElement
root.dataset.theme = localStorage.getItem('theme') || (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light')
document.getElementById('theme').onclick = () => {
  root.dataset.theme = root.dataset.theme === 'dark' ? 'light' : 'dark'
  localStorage.setItem('theme', root.dataset.theme)
  curves.rebuild()
}
document.querySelectorAll('[data-tab][role]').forEach(tab => {
  tab.onclick = () => {
    document.querySelector('main').dataset.tab = tab.dataset.tab
    document.querySelectorAll('[role="tab"]').forEach(one => one.setAttribute('aria-selected', one === tab))
    if (tab.dataset.tab === 'run') run.refresh()
    if (tab.dataset.tab === 'learn') learn.opened()
    window.dispatchEvent(new Event('resize'))
  }
})
document.getElementById('copy').onclick = () => navigator.clipboard.writeText(document.getElementById('command').textContent)

// Space stops the table wherever the focus is; only while nothing can move does it type a blank. Shift + space always types.
const idle = () => state.current.status && state.current.status.stage === 'off'
addEventListener('keydown', event => {
  const typing = ['INPUT', 'TEXTAREA'].includes(event.target.tagName) && event.target.type !== 'checkbox' && event.target.type !== 'range'
  if (event.code !== 'Space' || event.shiftKey || (typing && idle())) return
  event.preventDefault()
  event.stopImmediatePropagation()
  if (!event.repeat) run.stop()
}, true)
addEventListener('keyup', event => { if (event.code === 'Space' && !event.shiftKey && event.target.tagName === 'BUTTON') event.preventDefault() }, true)
addEventListener('message', event => { if (event.source === document.getElementById('report').contentWindow && event.data === 'stop') run.stop() })

curves.begin(); state.begin(); run.begin(); learn.begin(); twin.begin()
connect()
const answers = []
on('answer', answer => { answers.push(answer); if (answers.length > 50) answers.shift() })
window.shake = { stats, curves, state: state.current, answers }  // for tests and for the curious
