// The bridge in the menu: IP address, port, the Connection button and its status.
import { sentence } from '../actions'
import type { Connection } from '../connection'
import type { BridgeStatus } from '../messages'
import type { Store } from '../store'
import { h, setText } from './element'
import { row, section, state } from './fields'

const DEFAULTS = { host: '127.0.0.1', port: '4567' }
const WORDS = { closed: 'Disconnected', connecting: 'Connecting…', connected: 'Connected' }

export function bridge(store: Store, connection: Connection): HTMLElement {
  const typed = { ...DEFAULTS }
  const host = h('input', { testid: 'ip', placeholder: DEFAULTS.host, oninput: keep, ...FIELD })
  const digits = { inputmode: 'numeric' }
  const port = h('input', { testid: 'port', placeholder: DEFAULTS.port, oninput: keep, ...digits, ...FIELD })
  const connect = h('button', { testid: 'connect', class: 'primary', type: 'submit' }, 'Connect')
  const disconnect = h('button', { testid: 'disconnect', type: 'button', onclick: () => void end() }, 'Disconnect')
  const status = state('bridge-status')
  const fault = h('p', { class: 'fault', testid: 'bridge-fault', id: 'bridge-fault', role: 'alert', hidden: true })
  let refused = ''

  function keep(): void {
    typed.host = host.value
    typed.port = port.value
    refuse('')
  }

  function refuse(words: string, field?: HTMLInputElement): void {
    refused = words
    for (const each of [host, port]) each.setAttribute('aria-invalid', String(each === field))
    show(store.status.value?.bridge)
    field?.focus()
  }

  async function start(event: Event): Promise<void> {
    event.preventDefault()
    const address = host.value.trim()
    if (!address) return refuse('The IP address is empty. The default is 127.0.0.1, this machine.', host)
    if (/[\s/:]/.test(address.replace(/^\[.*\]$|^[0-9a-f:]+$/i, '')))
      return refuse('Only the address, please, without http:// and without the port, for example 192.168.0.12.', host)
    if (!/^\d+$/.test(port.value.trim()))
      return refuse('The port is a number from 1 to 65535. The default is 4567.', port)
    const number = Number(port.value)
    if (number < 1 || number > 65535) return refuse(`Port ${number} does not exist: ports go from 1 to 65535.`, port)
    refuse('')
    connect.disabled = true
    if (document.activeElement instanceof HTMLInputElement) document.activeElement.blur()
    try {
      await connection.request({ type: 'ConnectBridge', host: address, port: number })
    } catch (words) {
      refuse(sentence(words))
    }
    show(store.status.value?.bridge)
  }

  async function end(): Promise<void> {
    refuse('')
    try {
      await connection.request({ type: 'DisconnectBridge' })
    } catch (words) {
      refuse(sentence(words))
    }
  }

  function show(bridge: BridgeStatus | undefined): void {
    const now = bridge?.state ?? 'closed'
    const isOpen = now !== 'closed'
    connect.disabled = isOpen || store.link.value !== 'open'
    disconnect.hidden = !isOpen
    host.disabled = port.disabled = isOpen
    const at = bridge && isOpen ? parted(bridge.address) : typed
    if (host.value !== at.host) host.value = at.host
    if (port.value !== at.port) port.value = at.port
    setText(status, WORDS[now])
    status.dataset.state = now
    const words = refused || (bridge && now !== 'connected' && bridge.fault ? sentence(bridge.fault) : '')
    setText(fault, words)
    fault.hidden = !words
  }

  store.status.watch((status) => show(status?.bridge))
  store.link.watch(() => show(store.status.value?.bridge))
  store.resets.watch(() => {
    Object.assign(typed, DEFAULTS)
    refuse('')
  })
  return section(
    'Bridge',
    h(
      'form',
      { class: 'bridge', novalidate: true, onsubmit: (event: Event) => void start(event) },
      h('div', { class: 'address' }, named('IP Address', host), named('Port Number', port)),
      row(connect, status),
      disconnect,
      fault,
    ),
  )
}

const FIELD = {
  type: 'text',
  autocomplete: 'off',
  autocapitalize: 'off',
  spellcheck: 'false',
  'aria-describedby': 'bridge-fault',
}

function named(label: string, field: HTMLElement): HTMLElement {
  return h('label', { class: 'named' }, h('span', {}, label), field)
}

function parted(address: string): { host: string; port: string } {
  const end = address.lastIndexOf(':')
  return { host: address.slice(0, end), port: address.slice(end + 1) }
}
