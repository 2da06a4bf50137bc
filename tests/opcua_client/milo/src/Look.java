import java.io.BufferedReader;
import java.io.InputStreamReader;
import java.lang.reflect.Constructor;
import java.lang.reflect.Parameter;
import java.nio.file.Files;
import java.nio.file.Path;
import java.security.KeyFactory;
import java.security.KeyPair;
import java.security.PrivateKey;
import java.security.cert.CertificateFactory;
import java.security.cert.X509Certificate;
import java.security.spec.PKCS8EncodedKeySpec;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;
import java.util.concurrent.TimeUnit;
import java.util.concurrent.atomic.AtomicInteger;
import org.eclipse.milo.opcua.sdk.client.OpcUaClient;
import org.eclipse.milo.opcua.sdk.client.OpcUaClientConfigBuilder;
import org.eclipse.milo.opcua.sdk.client.OperationLimits;
import org.eclipse.milo.opcua.sdk.client.identity.AnonymousProvider;
import org.eclipse.milo.opcua.sdk.client.identity.IdentityProvider;
import org.eclipse.milo.opcua.sdk.client.identity.UsernameProvider;
import org.eclipse.milo.opcua.sdk.client.identity.X509IdentityProvider;
import org.eclipse.milo.opcua.sdk.client.subscriptions.OpcUaMonitoredItem;
import org.eclipse.milo.opcua.sdk.client.subscriptions.OpcUaSubscription;
import org.eclipse.milo.opcua.stack.core.AttributeId;
import org.eclipse.milo.opcua.stack.core.NodeIds;
import org.eclipse.milo.opcua.stack.core.Stack;
import org.eclipse.milo.opcua.stack.core.StatusCodes;
import org.eclipse.milo.opcua.stack.core.UaException;
import org.eclipse.milo.opcua.stack.core.security.DefaultClientCertificateValidator;
import org.eclipse.milo.opcua.stack.core.security.MemoryCertificateQuarantine;
import org.eclipse.milo.opcua.stack.core.security.MemoryTrustListManager;
import org.eclipse.milo.opcua.stack.core.types.UaRequestMessageType;
import org.eclipse.milo.opcua.stack.core.types.builtin.ByteString;
import org.eclipse.milo.opcua.stack.core.types.builtin.DataValue;
import org.eclipse.milo.opcua.stack.core.types.builtin.LocalizedText;
import org.eclipse.milo.opcua.stack.core.types.builtin.NodeId;
import org.eclipse.milo.opcua.stack.core.types.builtin.StatusCode;
import org.eclipse.milo.opcua.stack.core.types.builtin.Variant;
import org.eclipse.milo.opcua.stack.core.types.builtin.unsigned.UByte;
import org.eclipse.milo.opcua.stack.core.types.builtin.unsigned.UInteger;
import org.eclipse.milo.opcua.stack.core.types.enumerated.*;
import org.eclipse.milo.opcua.stack.core.types.structured.*;
import org.eclipse.milo.opcua.stack.core.util.validation.ValidationCheck;

/**
 * A foreign client: every policy, identity and certificate, and every service in each session that opens; then what a sound
 * client does. One line of JSON for each. java -cp ... Look ENDPOINT FOLDER USER PASSWORD SERVICE...
 */
public class Look {
  static final String[] POLICIES = {
    "None", "Basic128Rsa15", "Basic256", "Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss", "ECC_nistP256"
  };
  static final String[] IDENTITIES = {"right", "wrong password", "unknown user", "anonymous", "certificate"};
  static final String STRUCTURES = "org.eclipse.milo.opcua.stack.core.types.structured.";
  static final String URI = "http://opcfoundation.org/UA/SecurityPolicy#";
  static String address, user, password;
  static Path folder;
  static ByteString server;

  static X509Certificate certificate(String name) throws Exception {
    try (var in = Files.newInputStream(folder.resolve(name + ".der"))) {
      return (X509Certificate) CertificateFactory.getInstance("X.509").generateCertificate(in);
    }
  }

  static PrivateKey key(String name) throws Exception {
    return KeyFactory.getInstance("RSA").generatePrivate(new PKCS8EncodedKeySpec(Files.readAllBytes(folder.resolve(name + ".key.der"))));
  }

  static IdentityProvider identity(String what, String keys) throws Exception {
    return switch (what) {
      case "right" -> new UsernameProvider(user, password);
      case "wrong password" -> new UsernameProvider(user, "wrong wrong wrong");
      case "unknown user" -> new UsernameProvider("nobody", password);
      case "certificate" -> new X509IdentityProvider(certificate("client"), key("client"));
      default -> new AnonymousProvider();
    };
  }

  /** The server's certificate is trusted by its file, and all that Milo can check of it is checked. */
  static void configure(OpcUaClientConfigBuilder made, String keys, IdentityProvider identity) throws Exception {
    var trusted = new MemoryTrustListManager();
    trusted.addTrustedCertificate(certificate("server"));
    made.setApplicationName(LocalizedText.english("client"))
        .setApplicationUri("urn:example:client")
        .setCertificateValidator(
            new DefaultClientCertificateValidator(trusted, ValidationCheck.ALL_OPTIONAL_CHECKS, new MemoryCertificateQuarantine()))
        .setIdentityProvider(identity)
        .setKeepAliveInterval(UInteger.valueOf(1000))
        .setRequestTimeout(UInteger.valueOf(10000));
    if (!keys.isEmpty()) {
      made.setKeyPair(new KeyPair(certificate(keys).getPublicKey(), key(keys)))
          .setCertificate(certificate(keys))
          .setCertificateChain(new X509Certificate[] {certificate(keys)});
    }
  }

  /** An endpoint as a hostile client wants it: whatever the server says it has. */
  static EndpointDescription endpoint(String policy, MessageSecurityMode mode) {
    UserTokenPolicy[] tokens = {
      new UserTokenPolicy("anonymous", UserTokenType.Anonymous, null, null, null),
      new UserTokenPolicy("username", UserTokenType.UserName, null, null, null),
      new UserTokenPolicy("certificate", UserTokenType.Certificate, null, null, null)
    };
    var application =
        new ApplicationDescription("urn:gantryctl:server", "", LocalizedText.english(""), ApplicationType.Server, null, null, null);
    return new EndpointDescription(
        address, application, server, mode, URI + policy, tokens, Stack.TCP_UASC_UABINARY_TRANSPORT_URI, UByte.valueOf(0));
  }

  static String why(Throwable fault) {
    for (Throwable each = fault; each != null; each = each.getCause()) {
      if (each instanceof UaException refused) return name(refused.getStatusCode());
    }
    return fault.getClass().getSimpleName();
  }

  static String name(StatusCode status) {
    return StatusCodes.lookup(status.getValue()).map(row -> row[0].replace("_", "")).orElse(status.isGood() ? "Good" : status.toString());
  }

  static String json(Object value) {
    if (value instanceof Map<?, ?> map) {
      var parts = new ArrayList<String>();
      map.forEach((k, v) -> parts.add(json(k) + ":" + json(v)));
      return "{" + String.join(",", parts) + "}";
    }
    if (value instanceof Number || value instanceof Boolean) return value.toString();
    return "\"" + String.valueOf(value).replace("\\", "\\\\").replace("\"", "'") + "\"";
  }

  /** A request of a service with nothing in it; numbers are 0, lists are empty. */
  static UaRequestMessageType empty(OpcUaClient client, String service) throws Exception {
    return (UaRequestMessageType) empty(client, Class.forName(STRUCTURES + service + "Request"));
  }

  static Object empty(OpcUaClient client, Class<?> kind) throws Exception {
    Constructor<?> made = kind.getConstructors()[0];
    for (Constructor<?> each : kind.getConstructors()) {
      if (each.getParameterCount() > made.getParameterCount()) made = each;
    }
    var values = new ArrayList<Object>();
    for (Parameter each : made.getParameters()) values.add(value(client, each.getType()));
    return made.newInstance(values.toArray());
  }

  static Object value(OpcUaClient client, Class<?> kind) throws Exception {
    if (kind == RequestHeader.class) return client.newRequestHeader(client.getSession().getAuthenticationToken());
    if (kind == Boolean.class) return false;
    if (kind == Double.class) return 0.0;
    if (kind == UInteger.class) return UInteger.valueOf(0);
    if (kind == UByte.class) return UByte.valueOf(0);
    if (kind.isEnum()) return kind.getEnumConstants()[0];
    if (kind.getName().startsWith(STRUCTURES)) return empty(client, kind);
    return null;
  }

  static Map<String, String> services(OpcUaClient client, String[] names) {
    var said = new LinkedHashMap<String, String>();
    for (String service : names) {
      // They end what the others need.
      if (service.startsWith("Close") || service.equals("OpenSecureChannel")) continue;
      try {
        UaRequestMessageType request = empty(client, service);
        // Past the SDK, which would answer some by itself.
        var answer = client.getTransport().sendRequestMessage(request).get(5, TimeUnit.SECONDS);
        said.put(service, name(answer.getResponseHeader().getServiceResult()));
      } catch (ClassNotFoundException absent) {
        // Milo knows no such service.
      } catch (Throwable fault) {
        said.put(service, why(fault));
      }
    }
    return said;
  }

  static void matrix(String[] names) throws Exception {
    for (String policy : POLICIES) {
      var modes = policy.equals("None") ? new MessageSecurityMode[] {MessageSecurityMode.None}
          : new MessageSecurityMode[] {MessageSecurityMode.SignAndEncrypt, MessageSecurityMode.Sign};
      for (var mode : modes) {
        for (String keys : new String[] {"", "client", "stranger"}) {
          for (String identity : IDENTITIES) cell(policy, mode, keys, identity, names);
        }
      }
    }
  }

  static void cell(String policy, MessageSecurityMode mode, String keys, String identity, String[] names) {
    var row = new LinkedHashMap<String, Object>();
    row.put("policy", policy);
    row.put("mode", mode.name());
    row.put("key", keys);
    row.put("identity", identity);
    OpcUaClient client = null;
    try {
      var made = org.eclipse.milo.opcua.sdk.client.OpcUaClientConfig.builder().setEndpoint(endpoint(policy, mode));
      configure(made, keys, identity(identity, keys));
      client = OpcUaClient.create(made.build());
      client.connectAsync().get(15, TimeUnit.SECONDS);
      row.put("session", "Good");
      row.put("services", services(client, names));
    } catch (Throwable fault) {
      row.put("session", why(fault));
    } finally {
      try {
        if (client != null) client.disconnectAsync().get(1, TimeUnit.SECONDS);
      } catch (Exception ignored) {
        // It has none.
      }
    }
    System.out.println(json(row));
  }

  /** As an application does it: endpoints from the server, then reads, a subscription, a lost connection. */
  static void look(String policy) throws Exception {
    var said = new LinkedHashMap<String, Object>();
    said.put("look", policy);
    OpcUaClient client =
        OpcUaClient.create(
            address,
            found -> found.stream().filter(each -> each.getSecurityPolicyUri().equals(URI + policy)).findFirst(),
            transport -> {},
            made -> {
              try {
                configure(made, "client", new UsernameProvider(user, password));
              } catch (Exception fault) {
                throw new RuntimeException(fault);
              }
            });
    client.connect();
    var space = client.getNamespaceTable().getIndex("urn:gantryctl:axis");
    NodeId position = new NodeId(space, "Tags.pos_act_deg"), scan = new NodeId(space, "Tags.scan");
    said.put("position", client.readValue(0, TimestampsToReturn.Both, position).value().value());
    OperationLimits limits = client.getOperationLimits();
    said.put("limit_read", limits.maxNodesPerRead().map(UInteger::longValue).orElse(-1L));
    said.put("limit_browse", limits.maxNodesPerBrowse().map(UInteger::longValue).orElse(-1L));
    NodeId[] registered = client.registerNodes(List.of(position)).getRegisteredNodeIds();
    said.put("registered", client.readValue(0, TimestampsToReturn.Both, registered[0]).value().value());
    said.put("unregistered", name(client.unregisterNodes(List.of(registered)).getResponseHeader().getServiceResult()));
    said.put("nodes", client.getAddressSpace().browseNodes(NodeIds.RootFolder).size());
    said.put("references", browse(client, NodeIds.Server, 0));
    said.put("references_in_threes", browse(client, NodeIds.Server, 3));
    said.put("unit", client.getAddressSpace().getVariableNode(new NodeId(space, "Tags.pos_act_deg.EngineeringUnits")).readValue().statusCode().isGood());
    said.put("data_types", client.getDataTypeTree() != null);
    said.put("write", tried(() -> client.writeValues(List.of(position), List.of(DataValue.valueOnly(new Variant(1.0)))).get(0)));
    said.put("call", tried(() -> client.call(List.of(new CallMethodRequest(NodeIds.Server, NodeIds.Server_GetMonitoredItems, null))).getResponseHeader().getServiceResult()));
    said.put("transfer", tried(() -> client.transferSubscriptions(List.of(UInteger.valueOf(1)), true).getResponseHeader().getServiceResult()));
    said.put("republish", tried(() -> client.republish(UInteger.valueOf(1), UInteger.valueOf(1)).getResponseHeader().getServiceResult()));

    var changes = new AtomicInteger();
    var lost = new AtomicInteger();
    var subscription = new OpcUaSubscription(client, 200.0);
    subscription.setSubscriptionListener(
        new OpcUaSubscription.SubscriptionListener() {
          @Override
          public void onDataReceived(OpcUaSubscription from, List<OpcUaMonitoredItem> items, List<DataValue> values) {
            changes.addAndGet(values.size());
          }

          @Override
          public void onTransferFailed(OpcUaSubscription from, StatusCode status) {
            lost.incrementAndGet();
            // What Milo's documentation says to do then.
            new Thread(() -> {
              try {
                from.create();
                from.createMonitoredItems();
              } catch (UaException fault) {
                said.put("again", why(fault));
              }
            }).start();
          }
        });
    subscription.create();
    subscription.addMonitoredItem(OpcUaMonitoredItem.newDataItem(scan));
    subscription.addMonitoredItem(OpcUaMonitoredItem.newDataItem(position));
    for (var result : subscription.createMonitoredItems()) said.put("item", result.isGood());
    waitFor(() -> changes.get() > 4);
    said.put("changes", changes.get() > 4);
    System.out.println("{\"cut\":true}");
    new BufferedReader(new InputStreamReader(System.in)).readLine();
    int before = changes.get();
    waitFor(() -> lost.get() > 0 && changes.get() > before + 4);
    said.put("transfers_failed", lost.get());
    said.put("changes_after_cut", changes.get() > before + 4);
    subscription.delete();
    client.disconnect();
    System.out.println(json(said));
  }

  interface Tried {
    StatusCode get() throws UaException;
  }

  interface Holds {
    boolean now();
  }

  static String tried(Tried what) {
    try {
      return name(what.get());
    } catch (UaException refused) {
      return why(refused);
    }
  }

  static void waitFor(Holds what) throws InterruptedException {
    for (int n = 0; n < 300 && !what.now(); n++) Thread.sleep(100);
  }

  /** References of a node, at most so many an answer; the rest by BrowseNext. */
  static int browse(OpcUaClient client, NodeId node, int most) throws UaException {
    var wanted = new BrowseDescription(node, BrowseDirection.Forward, NodeIds.HierarchicalReferences, true, UInteger.valueOf(0), UInteger.valueOf(63));
    BrowseResult found = client.browse(new ViewDescription(NodeId.NULL_VALUE, null, UInteger.valueOf(0)), UInteger.valueOf(most), List.of(wanted)).getResults()[0];
    int count = found.getReferences().length;
    while (found.getContinuationPoint() != null && found.getContinuationPoint().isNotNull()) {
      found = client.browseNext(false, List.of(found.getContinuationPoint())).getResults()[0];
      count += found.getReferences().length;
    }
    return count;
  }

  public static void main(String[] arguments) throws Exception {
    // Milo names RSA-PSS as Bouncy Castle does.
    java.security.Security.addProvider(new org.bouncycastle.jce.provider.BouncyCastleProvider());
    address = arguments[0];
    folder = Path.of(arguments[1]);
    user = arguments[2];
    password = arguments[3];
    server = ByteString.of(Files.readAllBytes(folder.resolve("server.der")));
    String[] names = java.util.Arrays.copyOfRange(arguments, 4, arguments.length);
    System.out.println("{\"version\":\"Eclipse Milo " + OpcUaClient.SDK_VERSION + ", Java " + System.getProperty("java.version") + "\"}");
    matrix(names);
    for (String policy : new String[] {"Basic256Sha256", "Aes128_Sha256_RsaOaep", "Aes256_Sha256_RsaPss"}) look(policy);
    Stack.releaseSharedResources();
    System.exit(0);
  }
}
