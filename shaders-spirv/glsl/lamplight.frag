#version 460
// Light of lamps: added, it hides nothing.

layout(location = 0) in vec3 light;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(light, 0.0);
}
