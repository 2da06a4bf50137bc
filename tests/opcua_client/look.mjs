// A client that is not ours: reads the axis over OPC UA and tries to change it. Prints what happened as JSON.
// node look.mjs ENDPOINT CERTIFICATE KEY USER PASSWORD FOLDER
import opcua from "node-opcua-client";
import manager from "node-opcua-certificate-manager";

const { OPCUAClient, MessageSecurityMode, SecurityPolicy, UserTokenType, AttributeIds, DataType } = opcua;
const { OPCUACertificateManager } = manager;
const [endpoint, certificateFile, privateKeyFile, userName, password, folder] = process.argv.slice(2);

async function open(mode, policy, identity) {
  const clientCertificateManager = new OPCUACertificateManager({ rootFolder: folder, automaticallyAcceptUnknownCertificate: true });
  await clientCertificateManager.initialize();
  const client = OPCUAClient.create({
    applicationUri: "urn:example:client",
    applicationName: "client",
    certificateFile,
    privateKeyFile,
    clientCertificateManager,
    securityMode: mode,
    securityPolicy: policy,
    endpointMustExist: false,
    connectionStrategy: { maxRetry: 0, initialDelay: 100, maxDelay: 100 },
  });
  await client.connect(endpoint);
  return [client, await client.createSession(identity)];
}

async function fails(action) {
  try {
    const result = await action();
    return String(result?.statusCode?.name ?? result?.name ?? "done");
  } catch (error) {
    return "refused";
  }
}

const user = { type: UserTokenType.UserName, userName, password };
const said = {};
for (const policy of ["Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss"]) {
  const [client, session] = await open(MessageSecurityMode.SignAndEncrypt, SecurityPolicy[policy], user);
  said[policy] = (await session.readNamespaceArray()).includes("urn:gantryctl:axis");
  await session.close();
  await client.disconnect();
}
const [client, session] = await open(MessageSecurityMode.SignAndEncrypt, SecurityPolicy.Basic256Sha256, user);
const names = (await session.readNamespaceArray()).indexOf("urn:gantryctl:axis");
const node = (id) => `ns=${names};s=${id}`;
said.position = (await session.read({ nodeId: node("ReadActualPosition.Position"), attributeId: AttributeIds.Value })).value.value;
said.disabled = (await session.read({ nodeId: node("Axis.Disabled"), attributeId: AttributeIds.Value })).value.value;
said.machine = (await session.read({ nodeId: node("Tags.machine"), attributeId: AttributeIds.Value })).value.value;
// As a PLC does: register, read by what the server answers, release.
const registered = await session.registerNodes([node("Tags.pos_act_deg")]);
said.registered = (await session.read({ nodeId: registered[0], attributeId: AttributeIds.Value })).value.value;
await session.unregisterNodes(registered);
said.unit = (await session.read({ nodeId: node("Tags.pos_act_deg.EngineeringUnits"), attributeId: AttributeIds.Value })).value.value.unitId;
const range = (await session.read({ nodeId: node("Tags.pos_act_deg.EURange"), attributeId: AttributeIds.Value })).value.value;
said.range = range.high - range.low;
said.write = await fails(() => session.writeSingleNode(node("Tags.pos_act_deg"), { dataType: DataType.Double, value: 1 }));
await session.close();
await client.disconnect();
said.plain = await fails(() => open(MessageSecurityMode.None, SecurityPolicy.None, user));
said.signed = await fails(() => open(MessageSecurityMode.Sign, SecurityPolicy.Basic256Sha256, user));
said.old = await fails(() => open(MessageSecurityMode.SignAndEncrypt, SecurityPolicy.Basic256, user));
said.anonymous = await fails(() => open(MessageSecurityMode.SignAndEncrypt, SecurityPolicy.Basic256Sha256, { type: UserTokenType.Anonymous }));
said.wrong = await fails(() => open(MessageSecurityMode.SignAndEncrypt, SecurityPolicy.Basic256Sha256, { ...user, password: "wrong wrong wrong" }));
console.log(JSON.stringify(said));
process.exit(0);
