using System;
using System.Collections.Generic;
using Nep.Session;
using Nep.Wire;

namespace Nep
{
    /// <summary>Publishes messages on one topic. Created by <see cref="Node.CreatePublisher(string, string, PublisherOptions)"/>. Thread-safe.</summary>
    /// <example>
    /// <code>
    /// using (var node = new Node("sender"))
    /// using (Publisher publisher = node.CreatePublisher("example"))
    /// {
    ///     publisher.Publish(new { message = "hello" });
    /// }
    /// </code>
    /// </example>
    public sealed partial class Publisher : IDisposable
    {
        private readonly PublisherSocket _socket;
        private readonly Codec _codec;
        private readonly Node _node;

        internal Publisher(Node node, PublisherSocket socket, Codec codec, IList<string> missing)
        {
            _node = node;
            _socket = socket;
            _codec = codec;
            UnconnectedSubscribers = missing;
        }

        /// <summary>Topic.</summary>
        public string Topic
        {
            get { return _socket.Record.Topic; }
        }

        /// <summary>Type that it was created with, such as <c>json</c>.</summary>
        public string Type
        {
            get { return _socket.Record.MsgType; }
        }

        /// <summary>Number of messages published so far.</summary>
        public long Count
        {
            get { return (long)_socket.LastSeq; }
        }

        /// <summary>Number of subscribers that are connected.</summary>
        public int SubscriberCount
        {
            get { return _socket.SubscriberCount; }
        }

        /// <summary>Messages times subscribers that were not sent because too much was under way to a slow subscriber.</summary>
        public long Dropped
        {
            get { return _socket.Dropped; }
        }

        /// <summary>Names of nodes that subscribed and did not connect within 0.5 s when the publisher was created.</summary>
        public IList<string> UnconnectedSubscribers { get; private set; }

        /// <summary>Publish a payload. Returns at once; a subscriber that is too slow loses messages and counts them.</summary>
        /// <param name="payload">
        /// For <c>json</c> any object that the JSON serializer converts; for <c>string</c> a string; for <c>bytes</c> and <c>image</c> a byte[];
        /// for <c>msgpack</c> plain values, lists and dictionaries.
        /// </param>
        /// <exception cref="PayloadException">The payload has no form in the topic's codec. Nothing is sent.</exception>
        /// <exception cref="ObjectDisposedException">The publisher was closed.</exception>
        public void Publish(object payload)
        {
            if (_codec.Number == 5)
            {
                PublishImage(payload as byte[] ?? new byte[0]);
                return;
            }
            byte[] encoded;
            try
            {
                encoded = _codec.Encode(payload);
            }
            catch (PayloadException exception)
            {
                _socket.Problem = exception.Message;
                throw;
            }
            _socket.Send(encoded, null);
        }

        /// <summary>Publish JSON text that exists already. The caller answers for its being JSON.</summary>
        /// <param name="json">JSON text with at most 64 levels of lists and objects.</param>
        /// <exception cref="PayloadException">The topic has another codec, or the text is nested too deeply.</exception>
        /// <exception cref="ObjectDisposedException">The publisher was closed.</exception>
        public void PublishJson(string json)
        {
            if (_codec.Number != 1)
            {
                throw new PayloadException("A topic of type '" + _codec.Name + "' carries no JSON.");
            }
            _socket.Send(Codec.CheckedJson(json), null);
        }

        /// <summary>Publish a JPEG or PNG file on a topic of type <c>image</c>.</summary>
        /// <param name="file">Bytes of the file. They are copied.</param>
        /// <exception cref="PayloadException">The topic has another type, or it is neither JPEG nor PNG.</exception>
        /// <exception cref="ObjectDisposedException">The publisher was closed.</exception>
        public void PublishImage(byte[] file)
        {
            if (_codec.Number != 5)
            {
                throw new PayloadException("A topic of type '" + _codec.Name + "' carries no images.");
            }
            byte[] extension = MessagePackWriter.Write(ImageHeader.Describe(file));
            _socket.Send(_codec.Encode(file), extension);
        }

        /// <summary>Close: subscribers receive what was published, within <see cref="NodeOptions.CloseTimeout"/>.</summary>
        public void Close()
        {
            _node.Close(_socket);
        }

        /// <summary>Same as <see cref="Close"/>.</summary>
        public void Dispose()
        {
            Close();
        }
    }
}
