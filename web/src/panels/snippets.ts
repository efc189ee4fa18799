// The shortest programs that drive a vehicle of this simulator, with its actual address.

/** Address of the simulator as a program needs it. */
export interface Address {
  /** Link of the page, with the token if there is one. */
  link: string
  host: string
  port: number
  token: string
}

export interface Snippet {
  title: string
  /** What to install, and where the program runs. */
  note: string
  code: (address: Address, vehicle: string) => string
}

/** The address at which the browser found this page. */
export function addressOfPage(): Address {
  const link = new URL('.', document.baseURI)
  const token = new URLSearchParams(location.search).get('token') ?? ''
  if (token) link.searchParams.set('token', token)
  const port = Number(link.port) || (link.protocol === 'https:' ? 443 : 80)
  return { link: link.href, host: link.hostname.replace(/^\[|\]$/g, ''), port, token }
}

/** Topics of the ROS bridges begin with `nigel_1` for the first vehicle. */
const THROTTLE = '/autodrive/nigel_1/throttle_command'

export const SNIPPETS: readonly Snippet[] = [
  {
    title: 'Python',
    note:
      'Save it as drive.py. On the machine of the simulator, in its folder: .venv/bin/python drive.py. Elsewhere, install ' +
      'the client once, in a copy of the repository: pip install ./clients/python. Ctrl-C ends the program.',
    code: ({ link }, vehicle) => `import autodrive

with autodrive.Client(${JSON.stringify(link)}) as sim:
    sim.set_driving_mode(${JSON.stringify(vehicle)}, True)  # it obeys a script
    for frame in sim.frames(rate=30):
        car = frame.vehicles[${JSON.stringify(vehicle)}]
        print(f"{frame.time:.2f} s  {car.speed:.2f} m/s  {car.ips.position}")
        sim.drive(${JSON.stringify(vehicle)}, throttle=0.3, steering=0.2)
`,
  },
  {
    title: 'Devkit',
    note:
      'A script in the style of the AutoDRIVE devkits is a server. Start it, then press Connect in the menu and switch ' +
      'to Autonomous mode. It also works with the original simulator.',
    code: (_, vehicle) => `from autodrive.devkit import Nigel, drive

nigel = Nigel(${JSON.stringify(vehicle)}, is_left_positive=True)


def step():
    nigel.throttle_command = 0.3
    nigel.steering_command = 0.2


drive(step, nigel)  # listens on port 4567
`,
  },
  {
    title: 'C++',
    note: 'Install once: see docs/cpp.md. Link with the CMake target autodrive::compiled.',
    code: ({ host, port, token }, vehicle) => `#include <autodrive/client.hpp>
#include <iostream>

int main() {
    autodrive::Client simulator(${JSON.stringify(host)}, ${port}${token ? `, ${JSON.stringify(token)}` : ''});
    simulator.request({{"type", "SetDrivingMode"}, {"vehicle", ${JSON.stringify(vehicle)}}, {"is_autonomous", true}});
    autodrive::Command command;
    command.throttle = 0.3;
    command.steering = 0.2;
    while (true) {
        const autodrive::Frame frame = simulator.next();
        std::cout << frame.vehicles.at(${JSON.stringify(vehicle)}).pose.position.transpose() << std::endl;
        simulator.drive(${JSON.stringify(vehicle)}, command);
    }
}
`,
  },
  {
    title: 'ROS 1',
    note: 'Install once: scripts/ros1, in a copy of the repository. Each command runs in a terminal of its own.',
    code: ({ host, port, token }) =>
      `scripts/ros1 roslaunch autodrive_ros simulator_bringup_headless.launch \\
    host:=${host} port:=${port}${token ? ` token:=${token}` : ''}
scripts/ros1 rostopic pub -r 20 ${THROTTLE} std_msgs/Float32 0.3
`,
  },
  {
    title: 'ROS 2',
    note: 'Install once: see docs/ros2.md. Each command runs in a terminal of its own.',
    code: ({ host, port, token }) =>
      `ros2 run autodrive_ros2 autodrive_bridge --ros-args \\
    -p host:=${host} -p port:=${port}${token ? ` -p token:=${token}` : ''}
ros2 topic pub -r 20 ${THROTTLE} std_msgs/msg/Float32 "{data: 0.3}"
`,
  },
]
