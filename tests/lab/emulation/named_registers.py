"""Registers of emulated servos, by name, as instructions write and read them."""


def write(servo, name, value):
    register = servo.table.by_name[name]
    servo.write(register.address, register.encode(value))


def read(servo, name):
    register = servo.table.by_name[name]
    return register.decode(servo.read(register.address, register.size))
