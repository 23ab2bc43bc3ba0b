// A CANopen slave that somebody else wrote (npm canopen, CiA 301), behind slcan over TCP: node peer_slave.js EDS NODE
// Ours are the sockets, the text of slcan, and a drive machine in ten lines; SDO, PDO, NMT and heartbeat are theirs.
const net = require('net');
const { Device, Eds, DataType } = require('canopen');

const [path, number] = [process.argv[2], Number(process.argv[3])];
const eds = Eds.fromFile(path);
eds.addEntry(0x2fff, { parameterName: 'A long text', dataType: DataType.DOMAIN, accessType: 'rw' });
const device = new Device({ id: number, eds });
let socket = null;
let control = 0;
let state = 0x40;

device.on('message', ({ id, data }) => {
    const bytes = data || Buffer.alloc(0);
    const text = `t${id.toString(16).padStart(3, '0')}${bytes.length}${bytes.toString('hex')}\r`;
    if (socket) socket.write(text);
});

const get = (index) => Number(eds.getEntry(index).value);
const put = (index, value) => { eds.getEntry(index).value = value; };

// CiA 402: where a controlword leads, and what the statusword then says.
function drive() {
    const word = get(0x6040);
    const before = control;
    control = word;
    put(0x6061, get(0x6060));
    if (!(word & 0x02)) state = 0x40;
    else if (!(word & 0x04)) state = state === 0x27 || state === 0x07 ? 0x07 : 0x40;
    else if ((word & 0x07) === 0x06) state = state === 0x07 ? 0x07 : 0x21;
    else if ((word & 0x0f) === 0x07 && (state === 0x21 || state === 0x27)) state = 0x23;
    else if ((word & 0x0f) === 0x0f && (state === 0x23 || state === 0x07)) state = 0x27;
    if (state === 0x27 && word & 0x10 && !(before & 0x10)) put(0x6064, get(0x607a));
    put(0x6041, state | 0x10 | 0x400 | (state === 0x27 && word & 0x10 ? 0x1000 : 0));
}

function received(line) {
    if (line[0] !== 't') return;
    const id = parseInt(line.slice(1, 4), 16);
    const length = Number(line[4]);
    device.receive({ id, data: Buffer.from(line.slice(5, 5 + 2 * length), 'hex') });
    if (eds.getEntry(0x6041)) drive();
}

const server = net.createServer((accepted) => {
    socket = accepted;
    socket.setNoDelay(true);
    let rest = '';
    socket.on('data', (data) => {
        const lines = (rest + data.toString('ascii')).split('\r');
        rest = lines.pop();
        lines.forEach(received);
    });
    socket.on('close', () => process.exit(0));
    socket.on('error', () => process.exit(0));
    device.start();
});
server.listen(0, '127.0.0.1', () => console.log(`port ${server.address().port}`));
