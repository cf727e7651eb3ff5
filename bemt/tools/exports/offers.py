"""What exports offer to the house (:mod:`bemt.base.plugins`): targets that share a file, and the command."""

ACTIONS = {"export": "bemt.tools.exports.actions:export"}
EXPORTS = {
    "c81": "bemt.tools.exports.blades:C81Export",
    "table": "bemt.tools.exports.tables:TableExport",
    "fmu": "bemt.tools.exports.tables:FmuExport",
    "stl": "bemt.tools.exports.printing:StlExport",
    "obj": "bemt.tools.exports.printing:ObjExport",
    "step": "bemt.tools.exports.printing:StepExport",
    "3mf": "bemt.tools.exports.printing:ThreeMfExport",
    "flow": "bemt.tools.exports.printing:FlowExport",
    "zone": "bemt.tools.exports.printing:ZoneExport",
    "px4": "bemt.tools.exports.autopilots:Px4Export",
    "ardupilot": "bemt.tools.exports.autopilots:ArdupilotExport",
    "xrotor": "bemt.tools.exports.design_codes:XrotorExport",
    "qprop": "bemt.tools.exports.design_codes:QpropExport",
    "dfdc": "bemt.tools.exports.design_codes:DfdcExport",
    "su2-disk": "bemt.tools.exports.flow_solvers:Su2DiskExport",
    "flow360": "bemt.tools.exports.flow_solvers:Flow360Export",
    "fan": "bemt.tools.exports.flow_solvers:FanExport",
    "gazebo": "bemt.tools.exports.simulators:GazeboExport",
    "rotorpy": "bemt.tools.exports.simulators:RotorpyExport",
    "mujoco": "bemt.tools.exports.simulators:MujocoExport",
}
