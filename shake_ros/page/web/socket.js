// The line to the server: frames of samples, states, requests with their answers.
export const stats = { frames: 0, draws: 0, bytes: 0 }
const listeners = { frame: [], zoom: [], status: [], open: [], close: [], answer: [] }
export const on = (what, act) => listeners[what].push(act)
const tell = (what, value) => listeners[what].forEach(act => act(value))
const waiting = new Map()
let socket = null, count = 0, here = 0, view = null

export function decode(buffer, offset = 0) {
  const data = offset ? buffer.slice(offset) : buffer
  const [level, epoch, n, curves] = new Uint32Array(data, 0, 4)
  const [first, step] = new Float64Array(data, 16, 2)
  const numbers = new Float32Array(data, 32)
  const low = numbers.subarray(0, curves * n)
  const high = level ? numbers.subarray(curves * n) : low
  return { level, epoch, n, first, step, low: k => low.subarray(k * n, k * n + n), high: k => high.subarray(k * n, k * n + n) }
}

function connect() {
  socket = new WebSocket(location.origin.replace(/^http/, 'ws') + '/live')
  socket.binaryType = 'arraybuffer'
  socket.onopen = () => { if (view) send(view); tell('open') }
  socket.onmessage = event => {
    const now = performance.now()
    if (now - here > 250) { here = now; send({ do: 'here' }) }  // a hidden tab gets messages, but hardly any timer
    if (typeof event.data !== 'string') {
      stats.frames++; stats.bytes += event.data.byteLength
      const zoom = event.data.byteLength >= 4 && new Uint32Array(event.data, 0, 1)[0] === 0x6d6f6f7a
      tell(zoom ? 'zoom' : 'frame', decode(event.data, zoom ? 4 : 0))
      return
    }
    const message = JSON.parse(event.data)
    if (message.type === 'status') return tell('status', message)
    const done = waiting.get(message.id)
    waiting.delete(message.id)
    if (done) done(message)
    tell('answer', message)
  }
  socket.onclose = event => {
    waiting.forEach(done => done({ ok: false, text: 'the connection was lost' }))
    waiting.clear()
    tell('close', event)
    setTimeout(connect, 1000)
  }
}

function send(message) { if (socket && socket.readyState === 1) socket.send(JSON.stringify(message)) }

export function ask(what, how = {}) {
  if (!socket || socket.readyState !== 1) return Promise.resolve({ ok: false, text: 'not connected' })
  const id = ++count
  send({ ...how, do: what, id })
  return new Promise(done => waiting.set(id, done))
}

export function look(level, window, paused) { view = { do: 'view', level, window, paused }; send(view) }
export async function fetched(path, options) {
  const answer = await fetch(path, options)
  const content = await answer.json().catch(() => ({ error: `${path}: ${answer.status}` }))
  if (!answer.ok) throw new Error(content.error || `${path}: ${answer.status}`)
  return content
}
export { connect }
