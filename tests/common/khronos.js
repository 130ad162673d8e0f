// Prints the issues that the Khronos validator finds in a glTF file, as JSON.
const { validateBytes } = require("gltf-validator");

validateBytes(new Uint8Array(require("fs").readFileSync(process.argv[2]))).then(
    ({ issues }) => console.log(JSON.stringify(issues)),
    (error) => { console.error(error); process.exitCode = 1; });
