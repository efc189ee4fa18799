// The messages between the page and its worker. The worker has the connection and sends the commands of the user.
import type { Headlights, Indicators, Request, ServerMessage, Subscribe } from '../messages'

/** State of one input device, each value in [-1, 1]: throttle is positive forward, steering is positive to the left. */
export interface DriveInput {
  throttle: number
  steering: number
}

/** What the page tells the worker. */
export type PageMessage =
  /** Connect to that WebSocket, and reconnect whenever the connection is lost. */
  | { type: 'Open'; url: string }
  | Subscribe
  | Request
  /** Release the vehicle that is driven, and drive this one from now on. */
  | { type: 'Select'; vehicle: string }
  /** State of the inputs: keys are -1, 0 or 1 and are ramped; `direct` values of gamepad and touch are not. */
  | { type: 'Inputs'; keys: DriveInput; direct: DriveInput }
  /** Set all inputs to zero without a ramp. */
  | { type: 'Stop' }
  /** Switch these lamps on, or off if they are on. */
  | { type: 'Toggle'; headlights?: Headlights; indicators?: Indicators }
  /** The page has taken all messages; the worker may post more. */
  | { type: 'Taken' }

/** What the worker tells the page: the messages of the simulator, and what happened to the connection. */
export type WorkerMessage =
  | ServerMessage
  /** The connection was lost, or could not be made (`wasOpen` is false); `reason` is that of the simulator. */
  | { type: 'Lost'; reason: string; wasOpen: boolean }
  /** The simulator, which sends Status messages in a pause, too, has sent nothing for this time [s]. */
  | { type: 'Silence'; seconds: number }
  /** The simulator sends again, after a Silence. */
  | { type: 'Heard' }
  /** An input had no effect, because that vehicle is in autonomous mode. */
  | { type: 'Blocked'; vehicle: string }
  /** End of the messages that are posted at once; the page answers with `Taken`. */
  | { type: 'End' }

/** One end of the connection between the page and its worker. */
export interface Port<Out> {
  postMessage(message: Out): void
  addEventListener(type: 'message', listener: (event: MessageEvent) => void): void
}
