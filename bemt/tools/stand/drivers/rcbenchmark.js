// Paste into the program of an RCbenchmark stand (Automatic control, new script), then run: bemt stand CASE --on rcbenchmark
// Every result of the sensors goes out as JSON; a number that comes in is the pulse width [us]. Silence stops the motor.
var stop = 1000, patience_ms = 300, last = 0, turning = false;
rcb.console.setVerbose(false);
rcb.output.set("esc", stop);
rcb.udp.init(55047, "127.0.0.1", 64126, read);
rcb.udp.onReceive(function (bytes) {
    var us = Number(rcb.udp.ab2str(bytes));
    if (isNaN(us)) return;
    last = Date.now();
    turning = us > stop;
    rcb.output.set("esc", us);
});
function read() { rcb.sensors.read(tell, 5); }
function tell(result) { rcb.udp.send(rcb.udp.str2ab(JSON.stringify(result))); read(); }
setInterval(function () {
    if (turning && Date.now() - last > patience_ms) { turning = false; rcb.output.set("esc", stop); }
}, 50);
